#!/usr/bin/env bash
# The API reference from the docstrings: tools/api_reference.sh [FOLDER]. A warning is an error.
set -euo pipefail
cd "$(dirname "$0")/.."
modules=(  # what programs build on; the rest is read best in the code
    lemtomap lemtomap.errors lemtomap.samples lemtomap.types lemtomap.se2 lemtomap.odometry
    lemtomap.pipeline lemtomap.nav.navigator lemtomap.nav.types lemtomap.nav.config lemtomap.grid
    lemtomap.topo.config lemtomap.topo.events lemtomap.topo.file.store lemtomap.topo.file.reader
    lemtomap.topo.whole.layout lemtomap.topo.whole.export lemtomap.drivers.driver lemtomap.drivers.port
    lemtomap.drivers.errors lemtomap.drivers.hokuyo.events lemtomap.drivers.kobuki.events
    lemtomap.robot.build lemtomap.robot.missions.missions lemtomap.robot.motion.safety
    lemtomap.sim.floorplan lemtomap.sim.simulator
)
exec python -W error -m pdoc --docformat numpy --output-directory "${1:-build/api}" "${modules[@]}"
