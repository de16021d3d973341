"""The safety chain broken on purpose, one hand-made change at a time: every one must make a test fail.

A mutant is one change of one line: a comparison flipped, a rule dropped, a limit moved, a reaction weakened.
"""

from tools.checks.mutants import Mutant


def _m(name: str, old: str, new: str, path: str = "robot/motion/safety.py") -> Mutant:
    return Mutant(name, path, old, new)


VELOCITY, PROXIMITY = "robot/motion/velocity.py", "robot/motion/proximity.py"
WATCHDOG, SETTINGS = "robot/motion/watchdog.py", "lemtomap/settings.py"
MUTANTS = (
    _m(
        "permission starts true",
        "self._permitted = False\n        self._settle",
        "self._permitted = True\n        self._settle",
    ),
    _m("permit does nothing", "        self._permitted = True", "        self._permitted = False"),
    _m(
        "revoke does nothing", 'zero from now on."""\n        self._permitted = False', 'zero from now on."""'
    ),
    _m("permission ignored", "if not self._permitted:", "if False:"),
    _m(
        "nan speed passes",
        "if not (math.isfinite(v_mps) and math.isfinite(w_radps)):",
        "if not math.isfinite(w_radps):",
    ),
    _m(
        "infinite turn passes",
        "if not (math.isfinite(v_mps) and math.isfinite(w_radps)):",
        "if not math.isfinite(v_mps):",
    ),
    _m("faults ignored", "self._fault(evidence, now_s)\n            or self._hung", "self._hung"),
    _m("hung parts ignored", "            or self._hung(evidence, now_s)\n", ""),
    _m("silence ignored", "            or self._silence(v_mps, w_radps, evidence, now_s)\n", ""),
    _m("stop is not a stop", "return Allowed(0.0, 0.0, stop)", "return Allowed(v_mps, w_radps, stop)"),
    _m("turn survives a stop", "return Allowed(0.0, 0.0, stop)", "return Allowed(0.0, w_radps, stop)"),
    _m("base silence ignored", "if not _fresh(evidence.base_stamp_s, now_s, lim.base_age_s):", "if False:"),
    _m("base age flipped", "if not _fresh(evidence.base_stamp_s", "if _fresh(evidence.base_stamp_s"),
    _m("base age longer", "base_age_s: float = within(0.2,", "base_age_s: float = within(0.25,"),
    _m("base age shorter", "base_age_s: float = within(0.2,", "base_age_s: float = within(0.19,"),
    _m("wheel drop ignored", "elif evidence.wheel_drop:", "elif False:"),
    _m("over-current ignored", "elif evidence.over_current:", "elif False:"),
    _m("no settling", "self._settle_until_s = now_s + lim.settle_s", "pass"),
    _m("settling too short", "settle_s: float = within(0.5,", "settle_s: float = within(0.49,"),
    _m("settling at its edge", "elif now_s < self._settle_until_s:", "elif now_s <= self._settle_until_s:"),
    _m("settling flipped", "elif now_s < self._settle_until_s:", "elif now_s > self._settle_until_s:"),
    _m("power ignored", "return serious or self._power(evidence, now_s)", "return serious"),
    _m("only power", "return serious or self._power(evidence, now_s)", "return self._power(evidence, now_s)"),
    _m(
        "battery limit flipped",
        "if evidence.battery_v >= self.limits",
        "if evidence.battery_v <= self.limits",
    ),
    _m(
        "battery limit excluded",
        "if evidence.battery_v >= self.limits",
        "if evidence.battery_v > self.limits",
    ),
    _m(
        "battery never recovers",
        "            self._battery_low_since_s = None\n        elif",
        "            pass\n        elif",
    ),
    _m("battery clock restarts", "elif self._battery_low_since_s is None:", "else:"),
    _m(
        "battery empty ignored",
        "if since_s is not None and now_s - since_s >=",
        "if False and now_s - since_s >=",
    ),
    _m(
        "battery hold excluded",
        "now_s - since_s >= self.limits.battery_hold_s",
        "now_s - since_s > self.limits.battery_hold_s + 0.05",
    ),
    _m("battery without hold", "now_s - since_s >= self.limits.battery_hold_s", "now_s - since_s >= 0.0"),
    _m("adapter ignored", "if evidence.adapter:", "if False:"),
    _m("adapter flipped", "if evidence.adapter:", "if not evidence.adapter:"),
    _m(
        "velocity silence ignored",
        "if not _fresh(evidence.velocity_stamp_s, now_s, lim.velocity_age_s):",
        "if False:",
    ),
    _m("velocity age longer", "velocity_age_s: float = within(0.3,", "velocity_age_s: float = within(0.35,"),
    _m("velocity age shorter", "velocity_age_s: float = within(0.3,", "velocity_age_s: float = within(0.29,"),
    _m("hung map passes", "if not _fresh(evidence.map_stamp_s, now_s, self.limits.map_age_s):", "if False:"),
    _m("map age longer", "map_age_s: float = within(0.25,", "map_age_s: float = within(0.3,"),
    _m("map age shorter", "map_age_s: float = within(0.25,", "map_age_s: float = within(0.24,"),
    _m(
        "hung navigation passes",
        "if not _fresh(evidence.cycle_stamp_s, now_s, self.limits.cycle_age_s):",
        "if False:",
    ),
    _m("cycle age longer", "cycle_age_s: float = within(0.25,", "cycle_age_s: float = within(0.3,"),
    _m("cycle age shorter", "cycle_age_s: float = within(0.25,", "cycle_age_s: float = within(0.24,"),
    _m("newest scan counts", "return self._owed[0][1]", "return self._owed[-1][1]", WATCHDOG),
    _m("scans pile up", "if len(self._owed) < OWED_KEPT:", "if True:", WATCHDOG),
    _m(
        "a scan is owed for ever",
        "self._owed[0][0] <= done_s",
        "self._owed[0][0] < done_s",
        WATCHDOG,
    ),
    _m("first cycle never comes", "self._began_s if begun_s", "now_s if begun_s", WATCHDOG),
    _m("turning needs no scan", "if v_mps == 0.0 and w_radps == 0.0:", "if v_mps == 0.0:"),
    _m("driving needs no scan", "if v_mps == 0.0 and w_radps == 0.0:", "if w_radps == 0.0:"),
    _m("standing needs a scan", "if v_mps == 0.0 and w_radps == 0.0:", "if False:"),
    _m("scan silence ignored", "if not _fresh(evidence.scan_stamp_s, now_s, lim.scan_age_s):", "if False:"),
    _m("scan age longer", "scan_age_s: float = within(0.5,", "scan_age_s: float = within(0.6,"),
    _m("scan age shorter", "scan_age_s: float = within(0.5,", "scan_age_s: float = within(0.49,"),
    _m("blind laser passes", "if evidence.valid_beams < lim.scan_valid_beams:", "if False:"),
    _m(
        "blind limit moved",
        "if evidence.valid_beams < lim.scan_valid_beams:",
        "if evidence.valid_beams <= lim.scan_valid_beams:",
    ),
    _m(
        "no forward limit",
        "v = min(max(v_mps, -lim.reverse_max_mps), lim.v_max_mps)",
        "v = max(v_mps, -lim.reverse_max_mps)",
    ),
    _m(
        "no reverse limit",
        "v = min(max(v_mps, -lim.reverse_max_mps), lim.v_max_mps)",
        "v = min(v_mps, lim.v_max_mps)",
    ),
    _m(
        "no left turn limit",
        "w = min(max(w_radps, -lim.w_max_radps), lim.w_max_radps)",
        "w = max(w_radps, -lim.w_max_radps)",
    ),
    _m(
        "no right turn limit",
        "w = min(max(w_radps, -lim.w_max_radps), lim.w_max_radps)",
        "w = min(w_radps, lim.w_max_radps)",
    ),
    _m(
        "limits dropped",
        "allowed = self._limit(v_mps, w_radps)",
        "allowed = Allowed(v_mps, w_radps, Reason.CLEAR)",
    ),
    _m("contact dropped", "allowed = self._contact(allowed, evidence)", "pass"),
    _m("approach dropped", "return self._approach(allowed, evidence, now_s)", "return allowed"),
    _m("cliff ignored", "if not (evidence.cliff.any or evidence.bumper.any):", "if not evidence.bumper.any:"),
    _m("bumper ignored", "if not (evidence.cliff.any or evidence.bumper.any):", "if not evidence.cliff.any:"),
    _m(
        "left sensor ignored",
        "return self.left or self.centre or self.right",
        "return self.centre or self.right",
    ),
    _m(
        "centre sensor ignored",
        "return self.left or self.centre or self.right",
        "return self.left or self.right",
    ),
    _m(
        "right sensor ignored",
        "return self.left or self.centre or self.right",
        "return self.left or self.centre",
    ),
    _m(
        "forward after contact",
        "if allowed.v_mps > 0.0:\n            return Allowed(0.0, 0.0, reason)",
        "pass",
    ),
    _m(
        "turning while stopping",
        "return Allowed(0.0, 0.0, reason)",
        "return Allowed(0.0, allowed.w_radps, reason)",
    ),
    _m(
        "cliff called bumper",
        "reason = Reason.CLIFF if evidence.cliff.any else Reason.BUMPER",
        "reason = Reason.BUMPER",
    ),
    _m(
        "bumper called cliff",
        "reason = Reason.CLIFF if evidence.cliff.any else Reason.BUMPER",
        "reason = Reason.CLIFF",
    ),
    _m("turning counts as forward", "if allowed.v_mps > 0.0:", "if allowed.v_mps >= 0.0:"),
    _m("fast retreat", "v = max(allowed.v_mps, -lim.back_off_mps)", "v = allowed.v_mps"),
    _m("no retreat", "v = max(allowed.v_mps, -lim.back_off_mps)", "v = 0.0"),
    _m(
        "turning at a cliff",
        "return _lessened(allowed, v, 0.0, Reason.CLIFF)",
        "return _lessened(allowed, v, allowed.w_radps, Reason.CLIFF)",
    ),
    _m(
        "bumper before cliff",
        "        if evidence.cliff.any:\n",
        "        if evidence.cliff.any and not evidence.bumper.any:\n",
    ),
    _m(
        "fast turn when bumped left",
        "w = min(max(allowed.w_radps, -lim.bumped_w_max_radps), lim.bumped_w_max_radps)",
        "w = max(allowed.w_radps, -lim.bumped_w_max_radps)",
    ),
    _m(
        "fast turn when bumped right",
        "w = min(max(allowed.w_radps, -lim.bumped_w_max_radps), lim.bumped_w_max_radps)",
        "w = min(allowed.w_radps, lim.bumped_w_max_radps)",
    ),
    _m("gate's bounds forgotten", "        check_ranges(self)\n", "        pass\n"),
    _m("smoother's bounds forgotten", "        check_ranges(self)\n", "        pass\n", VELOCITY),
    _m("everything is an own part", "within(0.15, 0.0, 0.17,", "within(0.15, 0.0, 10.0,"),
    _m(
        "a bound is excluded",
        "return self.low <= value <= self.high",
        "return self.low <= value < self.high",
        SETTINGS,
    ),
    _m("no lower bound", "return self.low <= value", "return value", SETTINGS),
    _m("own posts block", "> lim.own_parts_m]", "> 0.0]"),
    _m("near points ignored", "> lim.own_parts_m]", "> 0.2]"),
    _m("no side margin", "radius_m = lim.body_radius_m + lim.side_margin_m", "radius_m = lim.body_radius_m"),
    _m("no stop gap", "radius_m) - lim.stop_gap_m", "radius_m)"),
    _m(
        "scan age forgotten",
        "delay_s = lim.reaction_s + max(0.0, now_s - evidence.scan_stamp_s)",
        "delay_s = lim.reaction_s",
    ),
    _m(
        "early scan shortens the delay",
        "max(0.0, now_s - evidence.scan_stamp_s)",
        "(now_s - evidence.scan_stamp_s)",
    ),
    _m("reaction time forgotten", "delay_s = lim.reaction_s + max(", "delay_s = 0.0 + max("),
    _m(
        "negative room reverses", "_stoppable_mps(max(0.0, free_m), delay_s", "_stoppable_mps(free_m, delay_s"
    ),
    _m(
        "speeds up to the limit",
        "share = min(1.0, safe_mps / abs(allowed.v_mps))",
        "share = safe_mps / abs(allowed.v_mps)",
    ),
    _m(
        "leaves the arc",
        "share * allowed.v_mps, turn * allowed.w_radps",
        "share * allowed.v_mps, allowed.w_radps",
    ),
    _m(
        "turns slower only",
        "share * allowed.v_mps, turn * allowed.w_radps",
        "allowed.v_mps, turn * allowed.w_radps",
    ),
    _m("no turning away", "turn = share if share > lim.creep_share else 1.0", "turn = share"),
    _m("brakes without limit", "2.0 * free_m / brake_mps2))", "0.0))"),
    _m("future stamps count", "return -CLOCK_SLACK_S <= now_s - stamp_s", "return now_s - stamp_s"),
    _m("no clock slack", "return -CLOCK_SLACK_S <= now_s", "return 0.0 <= now_s"),
    _m(
        "reason kept silent",
        "    return Allowed(v_mps, w_radps, reason)",
        "    return Allowed(v_mps, w_radps, allowed.reason)",
    ),
    _m("reason without cause", "if v_mps == allowed.v_mps and w_radps == allowed.w_radps:", "if False:"),
    _m(
        "reverse looks ahead",
        "x = points_base[:, 0] * math.copysign(1.0, v_mps)",
        "x = points_base[:, 0]",
        PROXIMITY,
    ),
    _m("touching points ignored", "return 0.0\n    x, y", "pass\n    x, y", PROXIMITY),
    _m(
        "touching behind blocks",
        "if bool(np.any(inside & (x > 0.0))):",
        "if bool(np.any(inside)):",
        PROXIMITY,
    ),
    _m("arc mirrored", "mirror = math.copysign(1.0, v_mps * w_radps)", "mirror = 1.0", PROXIMITY),
    _m("straight strip too wide", "ahead = (np.abs(y) < radius_m)", "ahead = (np.abs(y) < 9.0)", PROXIMITY),
    _m("looks behind", "& (x > 0.0)\n    if not bool(ahead", "\n    if not bool(ahead", PROXIMITY),
    _m("farthest point counts", "return float(np.min(", "return float(np.max(", PROXIMITY),
    _m("farthest arc point counts", "float(turned_rad.min())", "float(turned_rad.max())", PROXIMITY),
    _m(
        "priorities turned round",
        "key=lambda source: -source.priority",
        "key=lambda source: source.priority",
        VELOCITY,
    ),
    _m("sources never time out", "and now_s - wish.stamp_s <= source.timeout_s:", ":", VELOCITY),
    _m("a wish sticks", "self._wishes.pop(source.name, None)", "pass", VELOCITY),
    _m("no acceleration limit", "step = rise if abs(wanted) > abs(now) else fall", "step = 9.0", VELOCITY),
    _m(
        "rise for fall",
        "step = rise if abs(wanted) > abs(now) else fall",
        "step = rise if abs(wanted) < abs(now) else fall",
        VELOCITY,
    ),
    _m("jumps through zero", "if now * wanted < 0.0:", "if False:", VELOCITY),
    _m(
        "nan enters the ramp",
        "if not (math.isfinite(wanted.v_mps) and math.isfinite(wanted.w_radps)):",
        "if False:",
        VELOCITY,
    ),
    _m(
        "gate's stop forgotten",
        "self.sent = Twist(v_mps, w_radps)",
        "self.sent = Twist(max(v_mps, self.sent.v_mps), w_radps)",
        VELOCITY,
    ),
)
