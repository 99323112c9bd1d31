"""The weight files of an agent count by their content."""

from __future__ import annotations

import pytest
from agent_identities import AGENT, identity_with

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.cache_key import digests


def test_weights_count_by_their_content(module, tmp_path):
    agent = module("lonely_agent", AGENT).Agent
    weights = tmp_path / "weights.pt"
    agent.weights = (weights,)
    identities = []
    for content in (b"12345", b"12346", b"12345"):
        weights.write_bytes(content)
        identities.append(identity_with(agent))
    assert identities[0] == identities[2] != identities[1]
    weights.unlink()
    with pytest.raises(UsageError, match="names the weights"):
        identity_with(agent)


def test_a_folder_of_weights_counts_by_the_names_and_contents_of_its_files(module, tmp_path):
    agent = module("lonely_agent", AGENT).Agent
    folder = tmp_path / "checkpoint"
    (folder / "shards").mkdir(parents=True)
    (folder / "config.json").write_text("{}")
    (folder / "shards" / "1.bin").write_bytes(b"12345")
    (folder / "shards" / "around").symlink_to(folder)
    agent.weights = (folder,)
    first = identity_with(agent)
    (folder / ".lock").write_text("held")
    assert identity_with(agent) == first, "hidden files do not count"
    (folder / "shards" / "1.bin").write_bytes(b"12346")
    second = identity_with(agent)
    (folder / "shards" / "1.bin").rename(folder / "shards" / "2.bin")
    third = identity_with(agent)
    linked = tmp_path / "elsewhere"
    linked.mkdir()
    (folder / "more").symlink_to(linked)
    assert identity_with(agent) == third
    (linked / "3.bin").write_bytes(b"1")
    assert len({first, second, third, identity_with(agent)}) == 4


def test_all_of_a_large_weight_file_counts(module, tmp_path, monkeypatch):
    monkeypatch.setattr(digests, "_BLOCK_BYTES", 4)
    agent = module("lonely_agent", AGENT).Agent
    agent.weights = tmp_path / "weights.pt"
    identities = []
    for content in (b"1234567890", b"1234567891", b"1234567890"):
        agent.weights.write_bytes(content)
        identities.append(identity_with(agent))
    assert identities[0] == identities[2] != identities[1]


@pytest.mark.parametrize("weights", [[0.3, 0.7], 3, property(lambda self: "w.pt")])
def test_weights_that_are_no_files_are_refused(module, weights):
    made = module("weighing", AGENT)
    made.Agent.weights = weights
    with pytest.raises(UsageError, match=r"`weights` of the agent 'mine' is .*expected the paths of its weight files"):
        identity_with(made.Agent)


def test_no_weights_are_none(module):
    made = module("weighing", AGENT)
    without = identity_with(made.Agent)
    made.Agent.weights = None
    assert identity_with(made.Agent) == without
