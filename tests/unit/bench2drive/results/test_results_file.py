"""Result files of any content: a number that is right, or one sentence; never a traceback, never a hang."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from official_fuzzing import ANY, FUZZ, places, replaced, try_everything
from official_records import document, record

_WHOLE = document(record("1", share=12.34, red_light=1), record("2", status="Failed - TickRuntime"), planned=3)
_PLACES = places(_WHOLE)


@FUZZ
@given(st.sampled_from(_PLACES[1:]), st.just(...) | ANY)
def test_a_result_file_with_anything_anywhere(tmp_path: Path, place: tuple[Any, ...], new: object) -> None:
    path = tmp_path / "r.json"
    path.write_text(json.dumps(replaced(_WHOLE, place, new)), encoding="utf-8")
    try_everything(path)
