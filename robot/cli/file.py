"""Commands about map files."""

from pathlib import Path
from typing import Annotated

import typer

from lemtomap.robot.cli.help import add

MapFile = Annotated[Path, typer.Argument(metavar="MAP.lemto", help="the map file")]


def register(app: typer.Typer) -> None:
    """Add this module's commands to the program, in the order of the help page."""
    add(
        app,
        info,
        "lemtomap info office.lemto",
        "lemtomap info office.lemto --places                rooms, their doors and neighbours",
    )
    add(
        app,
        edit,
        "lemtomap edit office.lemto name 12 kitchen",
        "lemtomap edit office.lemto block kitchen 14        plan no way along this edge",
        "lemtomap edit office.lemto open kitchen 14",
        "lemtomap edit office.lemto delete-edge 3 97        a closure that is wrong",
        "lemtomap edit office.lemto level 31 -1",
        "lemtomap edit office.lemto area name 7 'office 3'  also merge, split, kind, find",
        "lemtomap edit office.lemto undo",
        takes_minus=True,
    )
    add(
        app,
        export,
        "lemtomap export office.lemto office.geojson        nav2 route server",
        "lemtomap export office.lemto office.indoor.geojson areas and doors; .gml: IndoorGML",
        "lemtomap export office.lemto office.tmap2          topological_navigation",
        "lemtomap export office.lemto office.g2o            or .graphml, .png",
    )


def info(
    map_file: MapFile,
    *,
    places: Annotated[bool, typer.Option("--places", help="list areas, doors and named nodes")] = False,
) -> None:
    """Show what a map holds."""
    from lemtomap.robot.cli import map_file as files

    typer.echo(files.info_places(map_file) if places else files.info(map_file))


def edit(
    map_file: MapFile,
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="WHAT...",
            help="name, unname, delete, delete-edge, block, open, level, area, undo, history",
        ),
    ],
) -> None:
    """Correct a map by hand; every edit can be undone."""
    from lemtomap.robot.cli import map_file as files

    typer.echo(files.apply_edit(map_file, words))


def export(
    map_file: MapFile,
    target: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help=".geojson, .indoor.geojson, .gml, .tmap2, .g2o, .graphml or .png"
        ),
    ],
) -> None:
    """Write a map for another program; its suffix says which."""
    from lemtomap.robot.cli import map_file as files

    typer.echo(files.export_map(map_file, target))
