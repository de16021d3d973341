"""`python -m lemtomap` is `lemtomap`."""

import sys

from lemtomap.robot.cli.main import main

sys.exit(main())
