"""Settings of the metric baseline."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AmclConfig:
    """Defaults of ROS amcl for a differential drive, unless said otherwise.

    Its motion noise (0.2 each) is that of wheels without a gyro: where a hall is wider than the laser sees,
    the particles spread over metres and the robot gets lost. Ours is that of a Kobuki, with room to spare.
    """

    least: int = 100
    most: int = 5000
    kld_error: float = 0.05  # ROS: 0.01 to 0.05
    kld_quantile: float = 2.326  # of 0.99
    update_m: float = 0.2
    update_rad: float = 0.2
    turn_from_turn: float = 0.02  # alpha1
    turn_from_way: float = 0.002  # alpha2
    way_from_way: float = 0.02  # alpha3
    way_from_turn: float = 0.02  # alpha4
    beams: int = 60
    sigma_hit_m: float = 0.2
    random_share: float = 0.05
    reach_m: float = 2.0  # laser_likelihood_max_dist
    resample_below: float = 0.5
