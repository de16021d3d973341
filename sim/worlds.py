"""Worlds by name or by file.

    office                 the small built-in one (default)
    office@4               four of them side by side: perceptual aliasing on purpose
    home                   swinging doors, people, chairs, glass, a ramp, a stairwell (sim/home.toml)
    offices:60:7           a floor of 60 rooms, seed 7
    plan.yaml, plan.yaml@4 a ROS map, or copies of it side by side
    office#1, home#1       the same on another day: some furniture stands elsewhere
    home.toml              a description (lemtomap.sim.toml_world)

`names()` lists the built-in ones, `describe` says what each is.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lemtomap.sim.errors import BadWorld
from lemtomap.sim.generators import (
    campus,
    corridor,
    loop,
    offices,
)
from lemtomap.sim.office import office
from lemtomap.sim.ros_map import load_ros_map, side_by_side
from lemtomap.sim.storeys import storeys
from lemtomap.sim.toml_world import load_toml
from lemtomap.sim.world import World

MAX_COPIES = 64
MAX_DAY = 9999
HOME = Path(__file__).with_name("home.toml")


@dataclass(frozen=True, slots=True)
class Recipe:
    """A built-in world: `make(size, seed)`, what the size counts, and its limits."""

    make: Callable[[int, int], World]
    size: int
    counts: str
    most: int
    about: str


RECIPES: dict[str, Recipe] = {
    "loop": Recipe(loop, 0, "people", 20, "a corridor round a core, rooms and halls outside, 24 x 18 m"),
    "offices": Recipe(offices, 60, "rooms", 1000, "rooms on both sides of parallel corridors"),
    "corridor": Recipe(corridor, 40, "metres", 1000, "the featureless corridor of the thesis' Appendix D"),
    "campus": Recipe(campus, 4, "buildings", 26, "different office buildings joined by covered walks"),
    "storeys": Recipe(storeys, 3, "levels", 8, "one floor above the other, joined by ramps"),
}


def names() -> list[str]:
    """Return the built-in worlds, the default first."""
    return ["office", HOME.stem, *RECIPES]


def describe() -> dict[str, str]:
    """Return a line about each built-in world."""
    lines = {"office": "a corridor and eight rooms, 16 x 10 m; office@4: four alike side by side"}
    lines[HOME.stem] = "a flat with all that makes life hard: sim/home.toml shows how worlds are described"
    for name, recipe in RECIPES.items():
        lines[name] = f"{recipe.about}; {name}:{recipe.size}:0 sets {recipe.counts} and seed"
    return lines


def load(name_or_path: str | Path, *, day: int = 0) -> World:
    """Return a world. On another `day` some furniture stands elsewhere (office and TOML worlds).

    Raises BadWorld in one line when the name is unknown or the file unusable.
    """
    text, marked_day = _split_number(str(name_or_path), "#", 0, MAX_DAY)
    text, copies = _split_number(text, "@", 1, MAX_COPIES)
    day = marked_day or day
    if text == "office":
        return office(copies, day)
    suffix = Path(text).suffix.lower()
    if suffix in {".yaml", ".yml"}:
        world = load_ros_map(Path(text))
        return side_by_side(world, copies) if copies > 1 else world
    if copies > 1:
        raise BadWorld(f"{name_or_path}: only 'office' and ROS maps can stand side by side")
    if text == HOME.stem:
        return load_toml(HOME, day=day)
    if suffix == ".toml":
        return load_toml(Path(text), day=day)
    return _generated(text)


def _split_number(text: str, mark: str, least: int, most: int) -> tuple[str, int]:
    """Return what stands before a mark and the number behind it, `least` when there is none."""
    base, found, number = text.rpartition(mark)
    if not found or "/" in number:
        return text, least
    if not number.isdigit() or not least <= int(number) <= most:
        raise BadWorld(f"{text}: after {mark} belongs a whole number, {least} to {most}")
    return base, int(number)


def _generated(text: str) -> World:
    name, *numbers = text.split(":")
    recipe = RECIPES.get(name)
    if recipe is None:
        raise BadWorld(f"{text}: no such world; known are {', '.join(names())}, a map .yaml or a world .toml")
    if len(numbers) > 2 or not all(number.isdigit() for number in numbers):
        raise BadWorld(f"{text}: expected {name}:{recipe.counts}:seed with whole numbers")
    size = int(numbers[0]) if numbers else recipe.size
    seed = int(numbers[1]) if len(numbers) > 1 else 0
    if size > recipe.most:
        raise BadWorld(f"{text}: at most {recipe.most} {recipe.counts}")
    return recipe.make(size, seed)
