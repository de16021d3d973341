import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lemtomap import se2

metres = st.floats(-1e3, 1e3)
poses = st.builds(se2.pose, metres, metres, st.floats(-np.pi, np.pi, exclude_max=True))


def close(a, b, tolerance=1e-8):
    return np.allclose(a[..., :2], b[..., :2], atol=tolerance) and np.allclose(
        se2.wrap_angle(a[..., 2] - b[..., 2]), 0.0, atol=tolerance
    )


@given(poses)
def test_between_a_pose_and_itself_is_identity(T_w_a):
    assert close(se2.between(T_w_a, T_w_a), se2.IDENTITY)


@given(poses, poses)
def test_between_undoes_compose(T_a_b, T_b_c):
    assert close(se2.between(T_a_b, se2.compose(T_a_b, T_b_c)), T_b_c, 1e-7)


@given(poses, poses, poses)
def test_compose_is_associative(a, b, c):
    assert close(se2.compose(se2.compose(a, b), c), se2.compose(a, se2.compose(b, c)), 1e-7)


@given(poses, poses)
def test_one_pose_and_a_row_of_poses_give_the_same(T_a_b, T_b_c):
    assert close(se2.compose(T_a_b[None], T_b_c)[0], se2.compose(T_a_b, T_b_c))
    assert close(se2.inverse(T_a_b[None])[0], se2.inverse(T_a_b))
    assert close(se2.between(T_a_b[None], T_b_c)[0], se2.between(T_a_b, T_b_c), 1e-7)


@given(poses, poses, metres, metres)
def test_transform_agrees_with_compose(T_a_b, T_b_c, x_m, y_m):
    point = np.array([x_m, y_m])
    once = se2.transform(se2.compose(T_a_b, T_b_c), point)
    assert np.allclose(once, se2.transform(T_a_b, se2.transform(T_b_c, point)), atol=1e-6)


@given(poses)
def test_adjoint_carries_a_small_motion_between_frames(T_a_b):
    step_b = np.array([1e-7, -2e-7, 1e-8])
    moved = se2.compose(se2.compose(T_a_b, step_b), se2.inverse(T_a_b))
    assert np.allclose(moved, se2.adjoint(T_a_b) @ step_b, atol=1e-11, rtol=1e-4)


@given(poses, poses)
def test_interpolate_starts_at_a_and_ends_at_b(a, b):
    assert close(se2.interpolate(a, b, 0.0), a, 1e-9)
    assert close(se2.interpolate(a, b, 1.0), b, 1e-9)
