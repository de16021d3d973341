"""Settings of place recognition, each with its unit and source. One set for every building and sensor."""

from dataclasses import dataclass, field, replace

from lemtomap.settings import check_order, refuse, within


@dataclass(frozen=True, slots=True)
class SearchConfig:
    """Correlative search and fine alignment (Olson 2009; Hess et al. 2016)."""

    cell_m: float = 0.1  # search cell: two window cells; the fine alignment does the rest
    spread_m: float = 0.1  # falloff of a score away from an obstacle: one search cell
    contradiction: int = -40  # score of a stored obstacle in space now seen free (an obstacle: 100)
    occupied_from: int = 40  # GridView occupancy that counts as an obstacle
    free_below: int = 25  # GridView occupancy that counts as seen free
    levels: int = within(6, 1, 8)  # pyramid: the coarsest bound covers 2**5 cells = 3.2 m
    angle_reach_m: float = 5.0  # lever arm that sets the angle step: turning by one moves no point a cell
    least_score: float = 0.32  # of a perfect match, below which nothing is looked for
    distinct_m: float = 0.6  # a runner-up is another place when it is at least this far away
    distinct_rad: float = 0.3  # ... or turned by this
    heap_blocks: int = within(
        60_000, 1_000, 600_000
    )  # 2 MB; a search that needs more is ambiguous and given up
    nearest_m: float = 0.3  # reach of the fine alignment
    line_reach_m: float = 0.25  # neighbourhood a wall's direction is taken from
    residual_m: float = 0.05  # scale of the robust weight: one window cell
    rounds: int = 12  # Gauss-Newton converges within this from half a search cell
    point_sigma_m: float = 0.03  # of one averaged point across its wall
    around_m: float = 4.0  # what the window shows so near to a place should be known: places reach 5 m
    correlation: float = 12.0  # neighbouring points err together: information is divided by this

    def __post_init__(self) -> None:
        if not 0.0 < self.least_score < 1.0:
            refuse("must lie between 0 and 1", least_score=self.least_score)
        if not 2 <= self.levels <= 8:
            refuse("must lie between 2 and 8", levels=self.levels)
        check_order(self, "free_below", "occupied_from")


@dataclass(frozen=True, slots=True)
class GateConfig:
    """How far off a place may be from where the graph expects it, and which places are worth a look."""

    outlook_nodes: int = 20_000  # nodes kept in view around the robot, 4 MB; further ones by look-up only
    outlook_per_update: int = 40  # nodes reached in one update: 0.3 ms
    renew_after: int = 16  # new nodes before the outlook starts afresh from where the robot is
    shift_var_m2_per_m: float = 0.02**2  # m^2 per m, on top of the edges' own: what a window's map is bent by
    turn_var_rad2_per_m: float = 0.004**2  # rad^2 per m, likewise
    arm_m: float = 10.0  # weighs heading against shift when ways are compared: half a window
    gate_sigmas: float = 3.0  # 99.7 % of what the graph itself thinks possible
    least_box_m: float = 1.0  # a search is never narrower than this
    least_box_rad: float = 0.15
    unsure_box_m: float = 1.2  # ... while the robot's own node is only predicted
    slip_m_per_m: float = 0.1  # ... more by this much of the way since: windows slip along corridors
    unsure_box_rad: float = 0.25
    widest_m: float = 9.0  # nor wider than the window: what is more doubtful is searched around the robot
    widest_rad: float = 1.0
    least_way_m: float = 12.0  # nearer places over edges lie in the window already
    reach_m: float = 4.0  # a place this near shares enough of the window
    near_nodes: int = 512  # weighed in one update, likeliest first
    window_m: float = 6.0  # ... this far from it: half as far again as `reach_m`, for the window's own slips

    def unsure(self, way_m: float) -> "GateConfig":
        """Return the gate for a robot whose own node has only been predicted in the window for a way."""
        half_m = min(self.unsure_box_m + self.slip_m_per_m * way_m, self.widest_m)
        return replace(self, least_box_m=half_m, least_box_rad=self.unsure_box_rad)


@dataclass(frozen=True, slots=True)
class LocatorConfig:
    """When a robot that does not know where it is has found out."""

    match: SearchConfig = field(default_factory=lambda: SearchConfig(least_score=0.6))
    """Of what is seen in a stored place: nearly all of it is there, even with a third of the chairs moved."""
    first_score: float = (
        0.75  # the first time round only what fits at a glance is looked for: three times faster
    )
    budget: int = 30_000  # bound evaluations in one update: 15 ms, of a robot that has nothing else to do
    picture_work: int = 6_000  # what reading a place costs, in bound evaluations
    ranked: int = 2400  # places compared bearing by bearing in each round, if the map has so many: 4 MB
    leaves: int = 96  # of the index opened for one look-up: what is seen is only a part of the place
    panorama_work: int = 1_200  # what looking round in a stored place costs, in bound evaluations, ...
    rank_work: int = 50  # ... and what comparing it does
    candidates: int = 48  # places searched in a round, the most alike first, ...
    first_candidates: int = 12  # ... and before the robot has looked all round: what it sees is alike to much
    all_round_m: float = 0.5  # travel or ...
    all_round_rad: float = (
        2.2  # ... turning after which 240 degrees have seen all round: one round more decides
    )
    again_m: float = 0.7  # travel or ...
    again_rad: float = 2.0  # ... turning after which a place may be tried again
    again_unlike: float = 0.06  # by which a place counts as less alike for each search in vain
    spacing_m: float = 2.5  # a search covers the places this near over edges
    box_m: float = 2.0  # half the side searched around a place
    view_m: float = 5.0  # what is farther from the robot may lie beyond what is stored
    view_points: int = 200
    look_m: float = 0.35  # travel or ...
    look_rad: float = 0.6  # ... turning between two looks
    follow_m: float = 6.0  # a guess goes over to the nearest place within this way, ...
    far_m: float = 15.0  # ... or within this one when none of those is near: a door may lead to a way round
    near_m: float = 1.5
    plausible: float = 0.6  # fit of a new guess, ...
    alive: float = 0.5  # ... of one that is kept, ...
    fit: float = 0.85  # ... and of the one believed (measured in four buildings: right 0.9 to 1)
    margin: float = 0.1  # by which every other must be worse (wrong ones: at best 0.86)
    clear_margin: float = 0.2  # ... by which they are so much worse that half the travel will do
    alone: int = 24  # points (a metre of wall) that the one believed explains and a near rival does not, ...
    alone_times: float = 6.0  # ... so many times those that only the rival does, tell the two apart as well
    guesses: int = 12  # kept at most
    checks: int = 3  # that a guess must have stood, ...
    moved_m: float = 0.8  # ... over this travel ...
    moved_rad: float = 5.5  # ... or nearly once round
    drift_m_per_m: float = 0.02  # of way, by which a place mapped twice may stand beside itself ...
    drift_rad_per_m: float = 0.003
    drift_way_m: float = 80.0  # ... over ways up to this
    drift_nodes: int = 800
    unknown_m: float = 20.0  # travel after which this is taken for a part of the building not mapped yet


@dataclass(frozen=True, slots=True)
class AuditConfig:
    """When a committed closure is taken back."""

    limit_chi2: float = 33.0  # off the way round it: 1 in 3,000,000 by chance (3 degrees); edges are no Gauss
    tight_m: float = 1.0  # a way round less sure than this confirms nothing
    least_against: int = 2  # witnesses against, when none speaks for it
    near_m: float = 4.0  # a place this near is seen whole in the window
    way_m: float = 15.0  # over edges, closures included: how far places are called as witnesses
    apart_m: float = 1.0  # travel between two hearings of one place


@dataclass(frozen=True, slots=True)
class LoopConfig:
    """When a place is believed to be one known before."""

    match: SearchConfig = field(default_factory=SearchConfig)
    gate: GateConfig = field(default_factory=GateConfig)
    locator: LocatorConfig = field(default_factory=LocatorConfig)
    audit: AuditConfig = field(default_factory=AuditConfig)
    budget: int = 6_000  # bound evaluations in one update: 4 ms
    candidates: int = 3  # places searched at one event, the most alike and likely first
    hearing: int = 24  # ... and before a closure is committed: all others within the gate, up to this
    spacing_m: float = 1.5  # of places heard; a place covers its neighbours
    again_after_m: float = 2.0  # travel before a place that did not fit is tried again
    company_m: float = 7.0  # places this near over edges are searched as one
    describe_m: float = 5.0  # half the side of what is compared: a node's localisation data reach as far
    search_points: int = 160  # a search needs no more; the alignment takes all
    score: float = 0.4  # a sighting: a rival of `rival` times this would have been seen
    slip_score: float = 0.6  # ... that says the window has slipped along a way known before
    alias_way_m: float = 25.0  # over edges, in which a place found elsewhere than the graph has it ...
    alias_near_m: float = 2.5  # ... must beat the place that the graph has there ...
    alias_points: int = 24  # ... by this many points, a metre of wall
    explained: float = 0.82  # least share of known points on obstacles, ...
    contradicted: float = 0.13  # ... most in free space (true revisits on three logs: 0.08 to 0.12), ...
    known: float = 0.5  # ... least in known space, ...
    rival: float = 0.8  # ... most a different pose may score, ...
    weakest: float = 0.12  # ... least share of the strongest axis' information on the weakest, ...
    points: int = 60  # ... and least explained: six metres of wall
    corridor: float = 0.25  # a sighting with less on the weakest axis counts ...
    corridor_weight: float = 0.67  # ... only this much: three are needed, over twice the way
    corridor_sigma_m: float = 0.3  # ... and it may be off so much along it (seen: up to 0.55 m)
    expected_m: float = 1.0  # a place this near to where the graph knows it to be needs not be unique, ...
    expected_sigma_m: float = (
        2.0  # ... if the graph knows it to this, one sigma (like halls are further apart)
    )
    expected_rad: float = 0.2  # ... if it turns as expected, ...
    expected_step_m: float = 0.25  # ... of poses along its wall so far apart (alignment reaches 0.3 m) ...
    expected_slack: float = 0.01  # ... and it is the nearest that explains as much as the best, to this share
    surprise: float = 2.5  # one so many sigmas from where the graph expects it counts half, ...
    found: float = 0.7  # ... and one in which less than this of what the window shows there is known
    refuted: float = 0.25  # share in free space from which a place is not where a belief says it must be
    sightings: int = 2  # that agree, before a closure is committed
    apart_m: float = 1.5  # travel between sightings that count
    agree_m: float = 0.35  # sightings agree when they put the same node within this ...
    agree_rad: float = 0.08  # ... and this
    forget_after_m: float = 12.0  # travel without a new sighting after which a hypothesis is dropped
