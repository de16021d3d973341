"""Commands about maps and recorded logs."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from lemtomap.robot.cli.help import Interrupted, add
from lemtomap.robot.cli.options import Config, Set


class Slam(StrEnum):
    """Which metric layer maps the log."""

    ROLLING = "rolling"
    GMAPPING = "gmapping"
    WINDOW = "window"


def register(app: typer.Typer) -> None:
    """Add this module's commands to the program, in the order of the help page."""
    add(
        app,
        map_,
        "lemtomap map intel.clf.xz --out out/intel",
        "lemtomap map exp1.dat --out out/exp1 --particles 10 --seed 3",
        "lemtomap map aces.clf --out out/aces --slam gmapping --particles 30    the baseline: no forgetting",
        name="map",
    )
    app.command(
        "bench",
        help="\b\n"
        "lemtomap bench                                     what can be measured\n"
        "lemtomap bench thesis --quick                      chapter 5 of the thesis, as a report\n"
        "lemtomap bench logs intel.clf.xz aces.clf.xz       every metric layer on recorded logs\n"
        "lemtomap bench scale                               the map of a drive of 1,000 km\n"
        "lemtomap bench soak --hours 4                      hours of driving: memory, CPU, closures, goals\n"
        "lemtomap bench --compare OLD.json NEW.json         what changed between two reports\n"
        "lemtomap bench --compare OLD.json                  its version and this one, in turns\n\n"
        "Measure; everything after the name goes to that bench (--help too).",
        short_help="Measure.",
        context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []},
    )(bench)


def map_(
    log: Annotated[
        Path, typer.Argument(metavar="LOG", help="CARMEN .clf/.log or tinySLAM .dat, also .gz/.xz")
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="folder for map, trajectory, picture and summary")],
    *,
    slam: Annotated[
        Slam | None,
        typer.Option(
            help="window: one pose, one rolling window (default); rolling: particles, a rolling window each "
            "(default with --particles); gmapping: particles, the whole grid each"
        ),
    ] = None,
    particles: Annotated[
        int | None, typer.Option(metavar="N", help="default 5 (rolling), 30 (gmapping)")
    ] = None,
    window: Annotated[
        float | None, typer.Option(metavar="M", help="width of the window, metres; default 20")
    ] = None,
    max_range: Annotated[
        float | None,
        typer.Option(metavar="M", help="usable range; at most half the window, which is also the default"),
    ] = None,
    field_of_view: Annotated[
        float | None,
        typer.Option(
            metavar="DEGREES",
            min=1.0,
            max=360.0,
            help="what the laser of a CARMEN log covers; default: as the log says, else by its beams",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(metavar="N", help="same log and seed: same map, byte for byte")] = 0,
    config: Config = None,
    orders: Set = None,
) -> None:
    """Make a map of a recorded log."""
    from lemtomap.robot.output.progress import progress_bar
    from lemtomap.robot.runs.map_log import MapLogOptions, chosen, map_log

    kind = slam or (Slam.WINDOW if particles is None else Slam.ROLLING)
    settings = chosen(kind.value, config, orders or (), particles, window, max_range)
    options = MapLogOptions(log, out, kind.value, settings, seed, field_of_view)
    try:
        with progress_bar(f"mapping {log.name}") as bar:
            told = map_log(options, bar)
    except KeyboardInterrupt as stopped:
        raise Interrupted(f"mapping of {log} interrupted; nothing was written to {out}") from stopped
    typer.echo(told)


def bench(
    context: typer.Context,
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="which bench; none: list them")] = None,
) -> None:
    """Measure."""
    from lemtomap.robot.cli.bench import benches, run_bench

    if name is None or name == "--help":
        typer.echo(context.get_help() + "\n")
        typer.echo("\n".join(f"  {known:<10} {about}" for known, about in sorted(benches().items())))
        return
    raise typer.Exit(run_bench(name.removeprefix("--"), context.args))
