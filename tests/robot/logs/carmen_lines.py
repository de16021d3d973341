"""Lines of CARMEN logs, written for tests."""

import math

from lemtomap import se2

STAMP = "976052857.337530"


def pose_text(pose):
    return " ".join(f"{value:.6f}" for value in pose)


def flaser(ranges, x=0.0, stamp=STAMP, pose=None, T_base_laser=(0.0, 0.0, 0.0)):
    base = (x, 0.0, 0.0) if pose is None else pose
    laser = pose_text(se2.compose(base, T_base_laser)) if pose is not None else "0.0 0.0 0.0"
    readings = " ".join(f"{r:.2f}" for r in ranges)
    return f"FLASER {len(ranges)} {readings} {laser} {pose_text(base)} {stamp} host 0.1"


def laser1_head(name, ranges, start_deg, fov_deg, step_deg, max_range_m):
    angles = " ".join(f"{math.radians(angle):.6f}" for angle in (start_deg, fov_deg, step_deg))
    readings = " ".join(f"{r:.2f}" for r in ranges)
    return f"{name} 0 {angles} {max_range_m} 0.01 0 {len(ranges)} {readings}"


def robotlaser1(
    ranges,
    *,
    start_deg=-90.0,
    fov_deg=180.0,
    step_deg=1.0,
    max_range_m=81.92,
    remissions=(),
    pose=(0.0, 0.0, 0.0),
    T_base_laser=(0.0, 0.0, 0.0),
    stamp=STAMP,
):
    head = laser1_head("ROBOTLASER1", ranges, start_deg, fov_deg, step_deg, max_range_m)
    bright = " ".join(str(value) for value in (len(remissions), *remissions))
    poses = f"{pose_text(se2.compose(pose, T_base_laser))} {pose_text(pose)}"
    return f"{head} {bright} {poses} 0.1 0.2 0.3 0.4 0.5 {stamp} host 0.1"


def rawlaser1(ranges, *, start_deg=-90.0, fov_deg=180.0, step_deg=1.0, max_range_m=81.92, stamp=STAMP):
    head = laser1_head("RAWLASER1", ranges, start_deg, fov_deg, step_deg, max_range_m)
    return f"{head} 0 {stamp} host 0.1"


def odom(pose, stamp):
    return f"ODOM {pose_text(pose)} 0.1 0.0 0.0 {stamp} host 0.1"


def written(tmp_path, *lines, name="a.clf", end="\n"):
    path = tmp_path / name
    path.write_text("\n".join(lines) + end)
    return path
