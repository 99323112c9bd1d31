from __future__ import annotations

import pytest
from result_factory import make_result

from pytest_drive_robust.store.base import MemoryStore
from pytest_drive_robust.store.folder import FolderStore

KEY = "abcdef0123456789"


@pytest.mark.parametrize("make", [lambda _: MemoryStore(), FolderStore], ids=["memory", "folder"])
def test_a_store_keeps_what_it_is_given(make, tmp_path):
    store = make(tmp_path)
    assert store.get(KEY) is None
    with store.claim(KEY) as claim:
        store.put(KEY, make_result("7"))
    claim.release()  # twice does no harm
    assert store.get(KEY).episode.route_id == "7"
    assert store.problems() == ()
