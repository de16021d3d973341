"""How much damage gets through the codecs and sessions? Random bytes, mutated frames, a noisy line.

    python -m tools.checks.fuzz_codecs                    10 million bytes, 1 million mutated frames a device
    python -m tools.checks.fuzz_codecs --frames 20000     a quick look

The true frames are those of the simulated robot on a drive through the office. A false sample is one that was
accepted and differs in any field from what the device sent under that stamp.
"""

import argparse
import operator
import random
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from lemtomap.drivers.hokuyo.codec import Decoder as HokuyoDecoder
from lemtomap.drivers.hokuyo.packets import BadReply, ScanFrame
from lemtomap.drivers.kobuki.codec import Decoder as KobukiDecoder
from lemtomap.drivers.kobuki.codec import encode
from lemtomap.drivers.kobuki.commands import BaseControl
from lemtomap.drivers.kobuki.events import KobukiSample
from lemtomap.drivers.kobuki.packets import TICKS_PER_METRE, Feedback
from lemtomap.drivers.kobuki.session import KobukiSession
from lemtomap.sim import scip, worlds
from lemtomap.sim.simulator import Simulator

PERIOD_S = 0.02


def flip_bits(frame: bytes, count: int, rng: random.Random) -> bytes:
    """Flip so many bits anywhere."""
    damaged = bytearray(frame)
    for position in rng.sample(range(8 * len(frame)), count):
        damaged[position // 8] ^= 1 << position % 8
    return bytes(damaged)


def replace_bytes(frame: bytes, count: int, rng: random.Random) -> bytes:
    """Put random bytes in the place of so many."""
    damaged = bytearray(frame)
    for position in rng.sample(range(len(frame)), count):
        damaged[position] = rng.randrange(256)
    return bytes(damaged)


def lose_bytes(frame: bytes, count: int, rng: random.Random) -> bytes:
    """Lose so many bytes anywhere."""
    lost = set(rng.sample(range(len(frame)), count))
    return bytes(byte for i, byte in enumerate(frame) if i not in lost)


def lose_zeros(frame: bytes, count: int, rng: random.Random) -> bytes:
    """Lose zero bytes, which an XOR does not notice."""
    zeros = [i for i, byte in enumerate(frame) if byte in {0, 0x30}]
    lost = set(rng.sample(zeros, min(count, len(zeros))))
    return bytes(byte for i, byte in enumerate(frame) if i not in lost)


def insert_bytes(frame: bytes, count: int, rng: random.Random) -> bytes:
    """Put random bytes in between."""
    damaged = bytearray(frame)
    for _ in range(count):
        damaged.insert(rng.randrange(len(damaged) + 1), rng.randrange(256))
    return bytes(damaged)


def lose_burst(frame: bytes, count: int, rng: random.Random) -> bytes:
    """Lose neighbouring bytes."""
    start = rng.randrange(len(frame))
    return frame[:start] + frame[start + 8 * count :]


Mutation = Callable[[bytes, int, random.Random], bytes]
MUTATIONS: dict[str, tuple[Mutation, int]] = {
    "1 bit flipped": (flip_bits, 1),
    "2 bits flipped": (flip_bits, 2),
    "3 bits flipped": (flip_bits, 3),
    "4 bits flipped": (flip_bits, 4),
    "1 byte replaced": (replace_bytes, 1),
    "2 bytes replaced": (replace_bytes, 2),
    "4 bytes replaced": (replace_bytes, 4),
    "1 byte lost": (lose_bytes, 1),
    "2 bytes lost": (lose_bytes, 2),
    "2 zeros lost": (lose_zeros, 2),
    "1 byte inserted": (insert_bytes, 1),
    "2 bytes inserted": (insert_bytes, 2),
    "8 bytes lost in a row": (lose_burst, 1),
    "24 bytes lost in a row": (lose_burst, 3),
}


@dataclass
class Row:
    """What became of one kind of damage."""

    frames: int = 0
    codec: int = 0
    """False frames the codec let through."""
    session: int = 0
    """False samples the session let through."""
    steering: int = 0
    """Of these: wheel wrong by more than 1 mm, heading by more than 0.1 degree, or a contact."""
    worst: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    neighbours_lost: int = 0
    """Undamaged frames next to a damaged one that were not recovered."""


def drive(seconds: float) -> list[bytes]:
    """Return the feedback packets of a simulated drive."""
    simulator = Simulator(worlds.load("office"), seed=3)
    packets, decoder = [], bytearray()
    for step in range(round(seconds / PERIOD_S)):
        simulator.advance((step + 1) * PERIOD_S)
        decoder += simulator.kobuki.read()
        turn = 0.8 if step % 400 > 250 else -0.3
        simulator.kobuki.write(encode(BaseControl.from_twist(0.25 if step % 400 < 300 else 0.0, turn)))
        while len(decoder) >= 4 and len(decoder) >= decoder[2] + 4:
            size = decoder[2] + 4
            packets.append(bytes(decoder[:size]))
            del decoder[:size]
    simulator.close()
    return packets


FIELDS = operator.attrgetter(
    "left_ticks", "right_ticks", "left_pwm", "right_pwm", "gyro_yaw_rad", "gyro_rate_radps", "bumper",
    "wheel_drop", "cliff", "buttons", "over_current", "cliff_adc", "left_current_a", "right_current_a",
    "docking_ir", "raw_gyro_id", "inputs",
)  # fmt: skip


def fuzz_kobuki(packets: Sequence[bytes], count: int, rng: random.Random) -> dict[str, Row]:
    """Mutate every second packet of the drive, over and over, and look at what comes out."""
    rows: dict[str, Row] = defaultdict(Row)
    true_frames = {packet: _one(packet) for packet in packets}
    truth = _true_samples(packets)
    done = 0
    while done < count:
        codec, session, row = KobukiDecoder(), KobukiSession(), Row()
        for index, packet in enumerate(packets):
            sent = packet
            if index % 2 and index > 10 and done < count:
                name, (mutate, size) = list(MUTATIONS.items())[done % len(MUTATIONS)]
                sent, row = mutate(packet, size, rng), rows[name]
                row.frames += 1
                done += 1
            frames = [event for event in codec.feed(sent) if isinstance(event, Feedback)]
            genuine = (true_frames[packets[index - 1]], true_frames[packet])
            row.codec += sum(frame not in genuine for frame in frames)
            row.neighbours_lost += sent is packet and genuine[1] not in frames
            for event in session.receive(sent, PERIOD_S * index):
                if isinstance(event, KobukiSample):
                    _judge(event, truth, row)
    return rows


def _one(packet: bytes) -> Feedback:
    (frame,) = KobukiDecoder().feed(packet)
    if not isinstance(frame, Feedback):
        raise TypeError(f"the simulated base sent {frame}")
    return frame


def _true_samples(packets: Sequence[bytes]) -> dict[int, KobukiSample]:
    session = KobukiSession()
    events = [event for i, packet in enumerate(packets) for event in session.receive(packet, PERIOD_S * i)]
    return {event.device_ms: event for event in events if isinstance(event, KobukiSample)}


def _judge(sample: KobukiSample, truth: dict[int, KobukiSample], row: Row) -> None:
    true = next((truth[ms] for d in (0, 1, -1) if (ms := sample.device_ms + d) in truth), None)
    if true is None:
        row.session += 1
        row.worst["stamps that do not exist"] += 1
        return
    same_stamp = sample.device_ms == true.device_ms
    if (
        same_stamp
        and FIELDS(sample) == FIELDS(true)
        and np.array_equal(sample.raw_gyro_radps, true.raw_gyro_radps)
    ):
        return
    row.session += 1
    wheel_mm = max(
        1000.0 * abs((ticks - true_ticks + 0x8000) % 0x10000 - 0x8000) / TICKS_PER_METRE
        for ticks, true_ticks in (
            (sample.left_ticks, true.left_ticks),
            (sample.right_ticks, true.right_ticks),
        )
    )
    yaw_deg = abs(
        np.degrees(np.remainder(sample.gyro_yaw_rad - true.gyro_yaw_rad + np.pi, 2 * np.pi) - np.pi)
    )
    contact = (sample.bumper, sample.cliff, sample.wheel_drop) != (true.bumper, true.cliff, true.wheel_drop)
    row.steering += bool(wheel_mm > 1.0 or yaw_deg > 0.1 or contact)
    row.worst["wheel mm"] = max(row.worst["wheel mm"], wheel_mm)
    row.worst["heading deg"] = max(row.worst["heading deg"], float(yaw_deg))
    row.worst["contacts"] += contact


def laser_replies(rng: np.random.Generator) -> Iterator[bytes]:
    """Return scans of 60 beams, as a corridor gives, each with its stamp."""
    stamp_ms = 5000
    while True:
        stamp_ms += 100
        values = (1500 + 300 * np.sin(np.arange(60) / 9.0) + rng.normal(0, 8, 60)).astype(np.int64)
        yield scip.reply("MD0300035901000", "99", scip.measurement(stamp_ms, values, 3))


def fuzz_hokuyo(count: int, rng: random.Random) -> dict[str, Row]:
    """Mutate every second scan; intact lines of damaged scans must be true, and undamaged scans whole."""
    rows: dict[str, Row] = defaultdict(Row)
    decoder = HokuyoDecoder()
    source = laser_replies(np.random.default_rng(4))
    pool = [next(source) for _ in range(500)]
    truth: dict[int, np.ndarray] = {}
    for reply in pool:
        truth.update((e.stamp_ms, e.raw_mm) for e in HokuyoDecoder().feed(reply) if isinstance(e, ScanFrame))
    for done in range(count):
        name = list(MUTATIONS)[done % len(MUTATIONS)]
        mutate, size = MUTATIONS[name]
        row = rows[name]
        row.frames += 1
        damaged, whole = pool[2 * done % 500], pool[(2 * done + 1) % 500]
        seen = [
            event
            for event in decoder.feed(mutate(damaged, size, rng) + whole)
            if isinstance(event, ScanFrame)
        ]
        for scan in seen:
            if scan.command != "MD0300035901":
                row.worst["another echo (the session refuses it)"] += 1
                continue
            true = truth.get(scan.stamp_ms)
            valid = np.full(60, 1, np.bool_) if scan.valid is None else scan.valid
            false = true is None or not np.array_equal(scan.raw_mm[valid], true[valid])
            row.codec += false
            row.session += false and scan.intact
            if true is None:
                row.worst["stamps that do not exist"] += 1
            elif false:
                row.worst["beams"] = max(row.worst["beams"], float((scan.raw_mm != true)[valid].sum()))
        row.neighbours_lost += not any(scan.intact for scan in seen[-1:])
    return rows


def fuzz_noise(size: int, rng: np.random.Generator) -> dict[str, int]:
    """Feed random bytes to both codecs; return how many samples each saw in them."""
    seen = {"kobuki": 0, "hokuyo": 0}
    kobuki, hokuyo = KobukiDecoder(), HokuyoDecoder()
    for _ in range(0, size, 4096):
        data = rng.bytes(4096)
        seen["kobuki"] += sum(isinstance(event, Feedback) for event in kobuki.feed(data))
        seen["hokuyo"] += sum(not isinstance(event, BadReply) for event in hokuyo.feed(data))
    return seen


def report(device: str, rows: dict[str, Row], columns: tuple[str, str], seconds: float) -> None:
    """Print one table."""
    total = sum(row.frames for row in rows.values())
    heads = ("frames", *columns, "steering", "neighbours lost")
    print(f"\n{device}: {total} mutated frames in {seconds:.0f} s")
    print(f"  {'damage':24}" + "".join(f"{head:>16}" for head in heads) + "  worst error")
    for name, row in rows.items():
        worst = ", ".join(f"{what} {value:.1f}" for what, value in row.worst.items() if value)
        counts = (row.frames, row.codec, row.session, row.steering, row.neighbours_lost)
        print(f"  {name:24}" + "".join(f"{count:16}" for count in counts) + f"  {worst}")
    false, lost = sum(row.session for row in rows.values()), sum(row.neighbours_lost for row in rows.values())
    print(f"  false samples accepted: {false} of {total}; whole neighbours recovered: {1 - lost / total:.4%}")


def main() -> None:
    """Run all and print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bytes", type=int, default=10_000_000, help="random bytes for each codec")
    parser.add_argument("--frames", type=int, default=1_000_000, help="mutated frames for each device")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    begin = time.process_time()
    seen = fuzz_noise(options.bytes, np.random.default_rng(options.seed))
    print(f"{options.bytes} random bytes in {time.process_time() - begin:.0f} s: false samples {seen}")
    begin = time.process_time()
    rows = fuzz_kobuki(drive(120.0), options.frames, random.Random(options.seed))
    report("Kobuki", rows, ("codec lets by", "session lets by"), time.process_time() - begin)
    begin = time.process_time()
    rows = fuzz_hokuyo(options.frames, random.Random(options.seed))
    report("Hokuyo", rows, ("any false beam", "in whole scans"), time.process_time() - begin)


if __name__ == "__main__":
    main()
