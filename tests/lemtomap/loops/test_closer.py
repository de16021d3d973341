"""What the end of a search means for the beliefs that wait for it."""

from types import SimpleNamespace

import pytest

from lemtomap.topo.loops.closer import LoopCloser
from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.loops.hypotheses import Hypothesis


@pytest.fixture
def closer():
    return LoopCloser(LoopConfig(), SimpleNamespace())


def conclude(closer, follows, supports, *, against):
    """End a search that was made for one belief and whose sighting, if any, supports another."""
    closer._judge = SimpleNamespace(
        sighted=lambda match, _: match if supports is not None else None,
        is_alias=lambda *_: False,
        sighting=lambda *_: None,
        contradicts=lambda _: against,
    )
    closer.hypotheses.add = lambda _: supports
    situation = SimpleNamespace(here_id=1)
    search = SimpleNamespace(match=SimpleNamespace())
    task = SimpleNamespace(
        node_id=5, situation=situation, search=search, on_trial=(), follows=follows, hearing_for=None
    )
    closer._conclude(task)


@pytest.mark.parametrize(("against", "rejected"), [(True, 1), (False, 0)])
def test_a_belief_whose_place_the_window_shows_to_be_something_else_is_rejected(closer, against, rejected):
    belief = Hypothesis([None, None])
    conclude(closer, belief, None, against=against)
    assert belief.rejected == rejected


def test_a_belief_that_the_search_bears_out_is_not_rejected_by_it(closer):
    belief = Hypothesis([None, None])
    conclude(closer, belief, belief, against=True)
    assert belief.rejected == 0


def test_a_sighting_for_another_belief_does_not_spare_the_one_followed(closer):
    belief, other = Hypothesis([None, None]), Hypothesis([None, None])
    conclude(closer, belief, other, against=True)
    assert belief.rejected == 1


@pytest.mark.parametrize(("done", "joined"), [(False, True), (True, False)])
def test_a_node_counts_as_joined_until_the_outlook_has_seen_all(closer, done, joined):
    assert closer.is_joined(9)

    class Seen(set):
        pass

    seen = Seen({1, 2})
    seen.done = done
    closer._outlook = seen
    assert closer.is_joined(9) is joined
    assert closer.is_joined(2)
