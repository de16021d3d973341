"""What the documents name is there."""

import re
import subprocess
from importlib.util import find_spec
from pathlib import Path

import pytest

from lemtomap.sim.toml_world import load_toml

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
FILE = re.compile(
    r"(?<![\w/.-])(?:drivers|examples|lemtomap|robot|sim|tests|tools)/[\w/]+\.(?:py|sh|toml|rules)\b"
)
LINK = re.compile(r"\]\((?!https?:)([^)#]+)")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_file_that_a_page_names_or_links_exists(page):
    text = page.read_text(encoding="utf-8")
    named = [ROOT / path for path in FILE.findall(text)]
    linked = [page.parent / path for path in LINK.findall(text)]
    assert [str(path) for path in (*named, *linked) if not path.exists()] == []


def test_the_walk_names_its_files():
    assert len(FILE.findall((ROOT / "docs" / "architecture.md").read_text(encoding="utf-8"))) > 30


def test_the_world_in_the_page_is_one(tmp_path):
    page = (ROOT / "docs" / "bring-your-own.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    (tmp_path / "flat.toml").write_text(text, encoding="utf-8")
    world = load_toml(tmp_path / "flat.toml")
    assert [room.name for room in world.truth.rooms] == ["west", "east"]
    assert len(world.truth.doors) == 1


@pytest.mark.skipif(find_spec("pdoc") is None, reason="the API reference needs pdoc")
def test_the_api_reference_is_built_without_a_warning(tmp_path):
    command = [str(ROOT / "tools" / "api_reference.sh"), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - our own
    assert done.returncode == 0, done.stderr
    assert "arning" not in done.stderr
    face = (tmp_path / "lemtomap.html").read_text(encoding="utf-8")
    assert all(f'id="{name}"' in face for name in ("Mapper.open", "Navigator.drive", "Scan.ranges_m"))
