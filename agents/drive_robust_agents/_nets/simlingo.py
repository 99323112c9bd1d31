"""The network of `simlingo`: image, speed, targets, prompt, answer and driving queries in one causal transformer.

A compact re-implementation of the architecture of SimLingo (Renz et al. 2025; `simlingo_training/models/driving.py`,
`adaptors.py`), never the original: 1.3 million parameters that know 95 words stand where InternVL2-1B stood.

Places of the sequence, each at a position that never changes::

    image 32 | prompt 22: <speed>, words, filler, <answer> | answer 16 | path queries 20 | speed queries 10

The image comes first (as InternVL's prompts have it), so that its part is computed once for several prompts. A place
looks at what stands before it, never at filler; without an answer the queries look past the empty places.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from drive_robust_agents._nets.blocks import BasicBlock, ConvBnRelu, ImageNorm, Mlp
from drive_robust_agents._nets.causal import Cache, Decoder
from drive_robust_agents._nets.manifest import spec_from
from drive_robust_agents._nets.prompts import ANSWER_SLOTS, PROMPT_SLOTS, by_targets, driving, prompt_row
from drive_robust_agents._nets.words import NEXT, PAD, SPEED, TARGET

__all__ = ["Driving", "SimLingoNet", "SimLingoSpec"]

_TARGET_M, _SPEED_MPS = 20.0, 12.0


@dataclass(frozen=True, slots=True)
class SimLingoSpec:
    """Sizes. The image is `height_px` x `width_px`; only its upper `kept_px` rows are read (published: 11 of 16).

    The encoder has a stem of stride 4 and, for each of `widths`, two residual blocks of which the first has stride 2.
    """

    height_px: int = 128
    width_px: int = 256
    kept_px: int = 96
    stem: int = 32
    widths: tuple[int, ...] = (48, 96)
    model: int = 128
    layers: int = 4
    heads: int = 4
    hidden: int = 512
    path: int = 20
    waypoints: int = 10
    words: int = 96


class Driving(NamedTuple):
    """`path` (N, 20, 2): points one metre apart. `waypoints` (N, 10, 2): 0.25 s apart. Ego frame, metres."""

    path: Tensor
    waypoints: Tensor


class SimLingoNet(nn.Module):
    """1.3 M parameters.

    Rows of a batch: image uint8 (N, height, width, 3) RGB; speed float32 (N,) m/s; target float32 (N, 2, 2) the next
    two target points in metres, ego frame (forward, right); prompt int64 (N, 22) numbers of words (`prompt_row`).
    """

    def __init__(self, spec: SimLingoSpec) -> None:
        super().__init__()
        self.spec = spec
        d = spec.model
        self.norm = ImageNorm()
        self.encoder = _encoder(spec)
        self.patches = nn.Conv2d(spec.widths[-1], d, (3, 1), (3, 1))
        stride = 4 * 2 ** len(spec.widths)
        self.image_places = spec.kept_px // stride // 3 * (spec.width_px // stride)
        self.speed = Mlp(4, 64, d, activation=nn.SiLU)
        self.targets = Mlp(4, 64, d, d, activation=nn.SiLU)
        self.words = nn.Embedding(spec.words, d)
        self.positions = nn.Parameter(0.02 * torch.randn(self.image_places + PROMPT_SLOTS + ANSWER_SLOTS, d))
        self.queries = nn.Parameter(0.02 * torch.randn(spec.path + spec.waypoints, d))
        self.decoder = Decoder(spec.layers, d, spec.heads, spec.hidden)
        self.path_head = Mlp(d, 2 * d, d, 2, activation=nn.SiLU)
        self.speed_head = Mlp(d, d, 2, activation=nn.SiLU)
        nn.init.normal_(self.words.weight, std=0.02)

    @classmethod
    def build(cls, spec: Mapping[str, Any]) -> SimLingoNet:
        """Return the network of a plain specification. Raises `TypeError` for one of another architecture."""
        return cls(spec_from(SimLingoSpec, spec))

    def example(self, rows: int) -> dict[str, Tensor]:
        """Return example inputs of the right shapes and types: a black image, standing, targets ahead, no answer."""
        return {
            "image": torch.zeros(rows, self.spec.height_px, self.spec.width_px, 3, dtype=torch.uint8),
            "speed": torch.zeros(rows),
            "target": torch.tensor([[[20.0, 0.0], [40.0, 0.0]]]).repeat(rows, 1, 1),
            "prompt": torch.tensor([prompt_row(driving(by_targets(0.0)))] * rows),
        }

    def parts(self, rows: int) -> dict[str, dict[str, Tensor]]:
        """Return inputs of `read`, `say` and `plan`, which `answer.answer_and_drive` runs."""
        given = self.example(rows)
        words = functional.pad(given["prompt"], (0, ANSWER_SLOTS), value=PAD)
        with torch.inference_mode():
            cache = torch.zeros_like(self.read(**given)["cache"])
        say = {"place": torch.zeros(rows, dtype=torch.int64), "words": words, "past": cache}
        return {"read": given, "say": say, "plan": {"words": words, "past": cache}}

    def forward(self, image: Tensor, speed: Tensor, target: Tensor, prompt: Tensor) -> dict[str, Tensor]:
        """Drive without an answer; return `path` and `waypoints` as in `Driving`."""
        return self.drive(self.see(image), speed, target, prompt)._asdict()

    def read(self, image: Tensor, speed: Tensor, target: Tensor, prompt: Tensor) -> dict[str, Tensor]:
        """Read image and prompt: `scores` (N, words) of the first word of an answer, and the `cache` with room for 16.

        The cache is (N, layers, 2, heads, places, d / heads): keys and values.
        """
        given = self._prompt(speed, target, prompt)
        hidden, cache = self.decoder(given, self.see(image), self._mask(prompt, 0), tail=1)
        packed = torch.stack([torch.stack(layer, dim=1) for layer in cache], dim=1)
        return {"scores": self._scores(hidden)[:, 0], "cache": functional.pad(packed, (0, 0, 0, ANSWER_SLOTS))}

    def say(self, place: Tensor, words: Tensor, past: Tensor) -> dict[str, Tensor]:
        """Read the word in a place (N,) of the answer, 0 to 15: `scores` (N, words) of the next one, and the `cache`.

        `words` (N, 38) are prompt and answer so far, with filler behind, `past` the last cache.
        """
        at = PROMPT_SLOTS + place
        x = self.words(words.gather(1, at[:, None])) + self.positions[self.image_places + at][:, None]
        known = functional.pad(words != PAD, (self.image_places, 0), value=True)
        room = [(layer[:, 0], layer[:, 1]) for layer in past.unbind(1)]
        hidden, room = self.decoder.put(x, room, self.image_places + at, known[:, None, None])
        packed = torch.stack([torch.stack(layer, dim=1) for layer in room], dim=1)
        return {"scores": self._scores(hidden)[:, 0], "cache": packed}

    def plan(self, words: Tensor, past: Tensor) -> dict[str, Tensor]:
        """Drive after an answer: `path` and `waypoints` as in `Driving`. `words` (N, 38) are prompt and answer."""
        queries = self._queries(words.shape[0])  # no len(): a graph has any number of rows
        mask = self._mask(words, queries.shape[1])[:, :, -queries.shape[1] :]
        cache = [(layer[:, 0], layer[:, 1]) for layer in past.unbind(1)]
        return self._heads(self.decoder(queries, cache, mask)[0])._asdict()

    # --- the parts ---

    def see(self, image: Tensor) -> Cache:
        """Read the image; return the cache with which every later part begins."""
        kept = image[:, : self.spec.kept_px]
        map_ = self.patches(self.encoder(self.norm(kept)))
        tokens = map_.flatten(2).transpose(1, 2) + self.positions[: self.image_places]
        cache: Cache = self.decoder(tokens, None, None, tail=0)[1]
        return cache

    def drive(self, seen: Cache, speed: Tensor, target: Tensor, prompt: Tensor) -> Driving:
        """Read the prompt and drive, without an answer."""
        x = torch.cat((self._prompt(speed, target, prompt), self._queries(prompt.shape[0])), dim=1)
        queries = self.spec.path + self.spec.waypoints
        hidden, _ = self.decoder(x, seen, self._mask(prompt, queries), tail=queries)
        return self._heads(hidden)

    def teach(
        self, seen: Cache, speed: Tensor, target: Tensor, prompt: Tensor, answer: Tensor
    ) -> tuple[Driving, Tensor]:
        """Read a prompt and a known answer (N, A <= 16): the driving after it, scores (N, A, words) of its words."""
        queries, places = self.spec.path + self.spec.waypoints, answer.shape[1]
        begin = self.image_places + PROMPT_SLOTS
        said = self.words(answer) + self.positions[begin : begin + places]
        x = torch.cat((self._prompt(speed, target, prompt), said, self._queries(prompt.shape[0])), dim=1)
        known = torch.cat((prompt, answer), dim=1)
        hidden, _ = self.decoder(x, seen, self._mask(known, queries), tail=1 + places + queries)
        return self._heads(hidden[:, 1 + places :]), self._scores(hidden[:, :places])

    # --- below ---

    def _prompt(self, speed: Tensor, target: Tensor, prompt: Tensor) -> Tensor:
        """Embed the prompt to (N, 22, d): words at their positions, measured numbers at their placeholders."""
        begin = self.image_places
        x: Tensor = self.words(prompt) + self.positions[begin : begin + PROMPT_SLOTS]
        # padded to four inputs: with fewer, the bits of a product depend on the row's place in memory
        speed_token = self.speed(functional.pad(speed[:, None] / _SPEED_MPS, (0, 3)))
        targets = self.targets(functional.pad(target / _TARGET_M, (0, 2)))
        for word, token in ((SPEED, speed_token), (TARGET, targets[:, 0]), (NEXT, targets[:, 1])):
            x = x + (prompt == word).to(x.dtype)[..., None] * token[:, None]
        return x

    def _queries(self, rows: int) -> Tensor:
        return self.queries.expand(rows, -1, -1)

    def _mask(self, known: Tensor, queries: int) -> Tensor:
        """Return the mask (N, 1, new, image + new); the new places are `known` words and then queries."""
        keys = functional.pad(known != PAD, (self.image_places, queries), value=True)
        new, places = known.shape[1] + queries, keys.shape[1]
        causal = torch.ones(new, places, dtype=torch.bool, device=known.device).tril(self.image_places)
        return (keys[:, None] & causal)[:, None]

    def _heads(self, hidden: Tensor) -> Driving:
        path, speed = hidden[:, : self.spec.path], hidden[:, self.spec.path :]
        return Driving(self.path_head(path).cumsum(dim=1), self.speed_head(speed).cumsum(dim=1))

    def _scores(self, hidden: Tensor) -> Tensor:
        return functional.linear(hidden, self.words.weight)


def _encoder(spec: SimLingoSpec) -> nn.Sequential:
    """Build the encoder: (N, 3, kept_px, width_px) -> (N, widths[-1], kept_px / 16, width_px / 16) with two widths."""
    blocks: list[nn.Module] = [ConvBnRelu(3, spec.stem, kernel=5, stride=4)]
    for inputs, outputs in pairwise((spec.stem, *spec.widths)):
        blocks += [BasicBlock(inputs, outputs, stride=2), BasicBlock(outputs, outputs)]
    return nn.Sequential(*blocks)
