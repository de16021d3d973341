"""The colours of a map, one for each thing, in the viewer, the pictures and the reports alike."""

from lemtomap.types import EdgeType

EDGES = {
    EdgeType.NEAR_NEIGHBOUR: "#e9a23b",
    EdgeType.ODOMETRY: "#2a9d8f",
    EdgeType.LOOP_CLOSING: "#d62828",
}
"""In the order in which they are drawn: closures are few, and go on top."""

NODE, HERE = "#1d3557", "#ff0080"
"""A node, and the one the robot is associated with."""
ROBOT, TRAIL = "#d62828", "#457b9d"
ROUTE, PATH, SCAN = "#ff0080", "#00c853", "#d62828"
CLOSED, WINDOW = "#14213d", "#888888"


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue, 0 to 255, of a colour written #rrggbb."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue
