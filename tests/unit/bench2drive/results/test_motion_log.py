"""Logs of motion, sentences and files of any content: a number that is right, or a refusal."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from official_fuzzing import ANY, FUZZ, places, replaced, try_everything
from official_records import document, motion_step, record, write

from pytest_drive_robust.bench2drive.results.official_record import official_speed_pct, speed_pct

_STEPS = {str(n): motion_step(forward=0.1, x_m=0.4 * n) for n in range(3)}


@settings(FUZZ, max_examples=300)
@given(st.sampled_from(places(_STEPS)), st.just(...) | ANY)
def test_a_log_of_motion_with_anything_anywhere(tmp_path: Path, place: tuple[Any, ...], new: object) -> None:
    item = record("1")
    path = write(tmp_path / "r.json", document(item))
    content = {} if place == () and new is ... else replaced(_STEPS, place, new)
    write(tmp_path / item["save_name"] / "metric_info.json", content)
    try_everything(path)


@settings(FUZZ, max_examples=300)
@given(st.text(alphabet="0123456789.%eE+- x٣", max_size=30))
def test_sentences_are_read_as_the_official_expression_reads_them(text: str) -> None:
    official = re.search(r"\b\d+\.?\d*%", text)
    assert official_speed_pct(text) == (None if official is None else float(official.group().rstrip("%")))
    meant = speed_pct(text)
    assert meant is None or 0.0 <= meant <= 1e18


def test_long_rows_of_digits_take_no_time() -> None:
    digits = "1" * 1_000_000
    assert official_speed_pct(digits) is None
    assert speed_pct(f"({digits}.{digits}") is None


@FUZZ
@given(ANY | st.binary(max_size=30))
def test_any_bytes_and_any_json(tmp_path: Path, content: object) -> None:
    path = tmp_path / "r.json"
    path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
    try_everything(path)
