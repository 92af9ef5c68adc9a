"""The systems of the zoo: every special point where it is known to be, and no other."""

from __future__ import annotations

import numpy as np
import pytest

from .zoo import CASES, Case

ENDS = {"EP", "MX"}


@pytest.fixture(params=list(CASES.values()), ids=list(CASES), scope="module")
def case(request: pytest.FixtureRequest) -> Case:
    found: Case = request.param
    return found


def test_special_points_are_where_they_are_known_to_be_and_no_others(case: Case) -> None:
    branch = case.branch()
    found = sorted((at.kind, at[case.free]) for at in branch.special if at.kind not in ENDS)
    known = sorted(case.special)
    assert [kind for kind, _ in found] == [kind for kind, _ in known]
    np.testing.assert_allclose(
        [value for _, value in found], [value for _, value in known], rtol=0, atol=case.tolerance
    )
    assert len(branch) > 4
    for at in branch if case.along else ():
        for value, wanted in case.along(at):
            np.testing.assert_allclose(value, wanted, rtol=case.tolerance, atol=case.tolerance)
