import pytest

from hdl.datapaths import DATAPATHS


@pytest.fixture(autouse=True)
def datapaths_keep_their_order():
    """What monkeypatch took out of a dict it puts back at the end; in tables the order shows."""
    before = dict(DATAPATHS)
    yield
    DATAPATHS.clear()
    DATAPATHS.update(before)
