"""Names that people give to places: one rule for what may be one, and how any other text is shown.

A map from elsewhere may hold names that break the rule. They are kept, and shown with escapes.
"""

import re
from collections.abc import Callable, Mapping
from difflib import get_close_matches

LONGEST_NAME = 80  # characters; more fits neither a line nor a picture
LONGEST_NUMBER = 15  # digits of a node's number
TOLD_NAMES = 10  # of a map, where the one that was asked for is not there
WORDS = frozenset(
    ("far", "start", "here", "any", "area", "node", "level", "explore", "tour", "goto", "dock", "idle")
)
"""What a mission or a place says already; a name must not mean something else there."""
_FORM = re.compile(r"(?P<word>\w+):.*|any .*", re.DOTALL)  # as in `level:2`, `any kitchen`
_NODE = re.compile(r"node[ _-]?\d+")
_NUMBER = re.compile(r"[+-]?\d+")
ALIKE = 0.5  # share of two names that agrees, from which one may have been meant for the other


def fault(name: str) -> str | None:
    """Return why a text cannot be the name of a place, None when it can."""
    word = name.casefold()
    form = _FORM.fullmatch(word)
    says_more = word in WORDS or (form is not None and form["word"] in (None, *WORDS))
    faults = {
        "it is empty": not name,
        f"it has {len(name)} characters, a name at most {LONGEST_NAME}": len(name) > LONGEST_NAME,
        "it holds characters that do not print": not name.isprintable(),
        "it begins or ends with a blank": name != name.strip(),
        "a comma parts missions": "," in name,
        "it would be taken for the number of a node": bool(_NUMBER.fullmatch(name) or _NODE.fullmatch(word)),
        "a mission means something else by it": says_more,
    }
    return next((why for why, holds in faults.items() if holds), None)


def shown(text: str, longest: int = LONGEST_NAME) -> str:
    """Return a text as it may be printed anywhere: on one line, what does not print escaped, cut if long."""
    cut = text if len(text) <= longest else text[: longest - 1] + "…"
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in cut)


def listed(name: str) -> str:
    """Return a name as it stands among others, within quotes when it breaks the rule."""
    return shown(name) if fault(name) is None else f"'{shown(name)}'"


def number(text: str) -> int | None:
    """Return the number of a node that a text is, None when it is none."""
    return int(text) if text.isdecimal() and len(text) <= LONGEST_NUMBER else None


def node_meant(text: str, names: Mapping[str, int], has_node: Callable[[int], bool]) -> int | None:
    """Return the node a person means by a number, a name, or a name as it is shown; None: there is none."""
    node_id = number(text)
    if node_id is not None and has_node(node_id):
        return node_id
    name = name_meant(text, names)
    return None if name is None else names[name]


def name_meant(text: str, names: Mapping[str, int]) -> str | None:
    """Return the name a person means, which they may have typed as it is shown; None: there is none."""
    if text in names:
        return text
    return next((name for name in names if fault(name) and text in (shown(name), listed(name))), None)


def told_instead(text: str, names: Mapping[str, int]) -> str:
    """Return what to say to a person who asked for a name that is not there: the nearest one, else all."""
    by_letters = {name.casefold(): name for name in names}
    near = get_close_matches(text[:LONGEST_NAME].casefold(), by_letters, n=1, cutoff=ALIKE)
    if near:
        return f"did you mean '{shown(by_letters[near[0]])}'?"
    some = ", ".join(listed(name) for name in sorted(names)[:TOLD_NAMES])
    return f"names: {some or 'none'}{', ...' if len(names) > TOLD_NAMES else ''}"
