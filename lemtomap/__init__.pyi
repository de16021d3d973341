from lemtomap.errors import BadInput as BadInput
from lemtomap.errors import BadLog as BadLog
from lemtomap.errors import BadMap as BadMap
from lemtomap.errors import BadSample as BadSample
from lemtomap.errors import BadSetting as BadSetting
from lemtomap.errors import LemtomapError as LemtomapError
from lemtomap.errors import NoRoute as NoRoute
from lemtomap.errors import NotStarted as NotStarted
from lemtomap.nav.navigator import Navigator as Navigator
from lemtomap.nav.types import Goal as Goal
from lemtomap.pipeline import Mapper as Mapper
from lemtomap.types import MapView as MapView
from lemtomap.types import Odometry as Odometry
from lemtomap.types import Scan as Scan
from lemtomap.types import Twist as Twist

__version__: str
