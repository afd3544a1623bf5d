"""PointNet++ for roofs: four set abstractions, two feature propagations, a head for points and one for the building.

After Qi et al., "PointNet++" (2017), single-scale grouping, with the relative positions divided by the ball's radius as
in Qian et al., "PointNeXt" (2022). Sampling and grouping happen outside (`segment.arrange`), so that the graph is a few
gathers and products. A quarter turn about Z is free: in evaluation the four turns of the canonical frame go through the
network together and their logits are averaged.

Tensors are flat over buildings: a batch of B clouds of N points is (B N, O, C) with O turns, and group indices count
rows of that flat tensor, so the same graph serves one building and many.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
from torch import nn

from ..segment.arrange import FEATURES, POSITION_SCALE, TURNED_PAIRS, Layout

QUARTER_TURNS = 4


@dataclass(frozen=True)
class NetworkSettings:
    """Widths of the network: `widths` of the four set abstractions as (first layer, output) pairs, and of the heads."""

    types: tuple[str, ...] = ()
    layout: Layout = field(default_factory=Layout)
    widths: tuple[tuple[int, int], ...] = ((32, 64), (64, 96), (96, 160), (160, 256))
    up_widths: tuple[int, int] = (96, 64)
    dropout: float = 0.2


class Dense(nn.Module):
    """Linear layer, batch normalisation and ReLU over the last axis."""

    def __init__(self, inputs: int, outputs: int):
        super().__init__()
        self.linear = nn.Linear(inputs, outputs, bias=False)
        self.norm = nn.BatchNorm1d(outputs)

    def forward(self, x):
        return torch.relu(normalised(self.norm, self.linear(x)))


class SetAbstraction(nn.Module):
    """PointNet over each group: two layers on (features, relative position / radius), then the maximum.

    The first layer is linear in the neighbour's features and in the difference of positions, so it is evaluated once
    a source and once a centre and subtracted after grouping: the same numbers for a tenth of the products. Its inputs
    are normalised already, so only the second layer is, after the maximum, where the rows are few.
    """

    def __init__(self, inputs: int, hidden: int, outputs: int):
        super().__init__()
        self.features = nn.Linear(inputs, hidden)
        self.position = nn.Linear(3, hidden, bias=False)
        self.second = nn.Linear(hidden, outputs, bias=False)
        self.norm = nn.BatchNorm1d(outputs)

    def forward(self, x, position, centres, group):
        """Features (rows, O, C) and positions over the radius (rows, O, 3) to the centres' features (S, O, outputs)."""
        source = self.features(x) + self.position(position)
        grouped = torch.relu(gathered(source, group) - self.position(centres).unsqueeze(1))
        return torch.relu(normalised(self.norm, self.second(grouped).max(dim=1)[0]))


class FeaturePropagation(nn.Module):
    """Coarse features interpolated at finer points, joined with the fine ones, through a layer.

    The layer's coarse half is applied before interpolation, with which it commutes and where the rows are few.
    """

    def __init__(self, coarse: int, fine: int, outputs: int):
        super().__init__()
        self.coarse, self.fine = nn.Linear(coarse, outputs, bias=False), nn.Linear(fine, outputs, bias=False)
        self.norm = nn.BatchNorm1d(outputs)

    def forward(self, coarse, fine, index, weight):
        """Coarse (rows, O, C) and fine features (S, O, D), interpolation `index`, `weight` (S, 3): (S, O, outputs)."""
        joined = interpolated(self.coarse(coarse), index, weight) + self.fine(fine)
        return torch.relu(normalised(self.norm, joined))


class GlobalAbstraction(nn.Module):
    """The last set abstraction: one group of everything."""

    def __init__(self, inputs: int, hidden: int, outputs: int):
        super().__init__()
        self.first, self.second = Dense(inputs + 3, hidden), Dense(hidden, outputs)

    def forward(self, x, position, size: int):
        y = self.second(self.first(torch.cat([x, position], dim=-1)))
        return y.reshape(-1, size, *y.shape[1:]).max(dim=1)[0]


class RoofNetwork(nn.Module):
    """Logits of every point (types, then not-roof last) and of the building's type from arranged clouds."""

    def __init__(self, settings: NetworkSettings):
        super().__init__()
        self.settings = settings
        widths, up, classes = settings.widths, settings.up_widths, len(settings.types)
        inputs = [len(FEATURES), *(output for _, output in widths)]
        self.down = nn.ModuleList(SetAbstraction(inputs[i], *widths[i]) for i in range(3))
        self.everything = GlobalAbstraction(inputs[3], *widths[3])
        self.up = nn.ModuleList(
            [
                FeaturePropagation(inputs[3] + inputs[4], inputs[1], up[0]),
                FeaturePropagation(up[0], len(FEATURES), up[1]),
            ]
        )
        self.dropout = nn.Dropout(settings.dropout)
        self.point_head = nn.Linear(up[1], classes + 1)
        self.type_head = nn.Sequential(Dense(inputs[4], 96), nn.Dropout(settings.dropout), nn.Linear(96, classes))
        self.register_buffer("turns", turn_matrices())
        self.register_buffer("metres", torch.tensor(POSITION_SCALE))

    def forward(self, features, group1, group2, group3, radii, up_index1, up_index2, up_weight1, up_weight2):
        """See `segment.arrange.Arrangement`; `features` (B N, 11), indices into flat rows, `radii` (B, 3).

        Returns point logits (B N, types + 1) and type logits (B, types), averaged over the quarter turns in evaluation;
        in training no turn is applied (the loader draws one).
        """
        turns = self.turns[:1] if self.training else self.turns
        x = torch.einsum("nc,ocd->nod", features, turns)
        sizes = (self.settings.layout.points, *self.settings.layout.levels)
        metres = x[:, :, :3] * self.metres
        levels, position = [x], metres
        for i, (layer, group) in enumerate(zip(self.down, (group1, group2, group3), strict=True)):
            scaled = over_radius(position, radii[:, i], sizes[i])
            centres = first_rows(scaled, sizes[i], sizes[i + 1])
            levels.append(layer(levels[-1], scaled, centres, group))
            position = first_rows(position, sizes[i], sizes[i + 1])
        building = self.everything(levels[3], position / 10.0, sizes[3])
        coarse = torch.cat([levels[3], building.repeat_interleave(sizes[3], dim=0)], dim=-1)
        middle = self.up[0](coarse, levels[1], up_index1, up_weight1)
        fine = self.up[1](middle, levels[0], up_index2, up_weight2)
        return self.point_head(self.dropout(fine)).mean(dim=1), self.type_head(building).mean(dim=1)


def normalised(norm: nn.BatchNorm1d, x):
    """Batch normalisation over the last axis, whatever the axes before it."""
    return norm(x.reshape(-1, x.shape[-1])).reshape(x.shape)


def gathered(x, index):
    """Rows of `x` (rows, O, C) by `index` (S, K): (S, K, O, C)."""
    return x.index_select(0, index.reshape(-1)).reshape(*index.shape, *x.shape[1:])


def interpolated(x, index, weight):
    """Weighted mean of the rows of `x` (rows, O, C) named by `index` (S, 3)."""
    return (gathered(x, index) * weight.unsqueeze(-1).unsqueeze(-1)).sum(dim=1)


def first_rows(x, size: int, kept: int):
    """The first `kept` of each building's `size` rows: farthest-point samples are prefixes of one another."""
    return x.reshape(-1, size, *x.shape[1:])[:, :kept].reshape(-1, *x.shape[1:])


def over_radius(position, radius, size: int):
    """Positions (B size, O, 3) divided by their building's radius (B,)."""
    grouped = position.reshape(-1, size, *position.shape[1:])
    return (grouped / radius.reshape(-1, 1, 1, 1)).reshape(position.shape)


def turn_matrices():
    """(4, 11, 11): a row of features times matrix k is that row after k quarter turns about Z."""
    turns = torch.eye(len(FEATURES)).repeat(QUARTER_TURNS, 1, 1)
    for k, (c, s) in enumerate(((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))):
        for x, y in TURNED_PAIRS:
            turns[k, x, x], turns[k, x, y], turns[k, y, x], turns[k, y, y] = c, s, -s, c
    return turns
