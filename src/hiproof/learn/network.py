"""PointNet++ for roofs.

It has four set abstractions, two feature propagations, a head for points and one for the building.

After Qi et al., "PointNet++" (2017), single-scale grouping, with the relative positions divided by
the ball's radius as in Qian et al., "PointNeXt" (2022). Sampling and grouping happen outside
(`segment.arrange`), in the building's own axes, so that the graph is a few gathers and products.

Tensors are flat over buildings: a batch of B clouds of N points is (B N, C), and group indices
count rows of that flat tensor, so the same graph serves one building and many. All sizes but B are
constants of the graph: reading them off the tensors would take more nodes than the arithmetic.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import torch
from torch import nn

from ..segment.arrange import Arrangement, Layout, arrange
from ..segment.inference import stack_arrangements
from ..segment.sampling import POINT_FEATURES, POSITION_SCALE


@dataclass(frozen=True)
class NetworkSettings:
    """Widths of the network: (first layer, output) of four set abstractions, and heads."""

    types: tuple[str, ...] = ()
    layout: Layout = field(default_factory=Layout)
    widths: tuple[tuple[int, int], ...] = ((32, 64), (64, 96), (96, 160), (160, 256))
    up_widths: tuple[int, int] = (96, 64)
    dropout: float = 0.2


class Dense(nn.Module):
    """Linear layer, batch normalisation and ReLU over rows."""

    def __init__(self, inputs: int, outputs: int):
        super().__init__()
        self.linear = nn.Linear(inputs, outputs, bias=False)
        self.norm = nn.BatchNorm1d(outputs)

    def forward(self, x):
        return torch.relu(self.norm(self.linear(x)))


class SetAbstraction(nn.Module):
    """PointNet over each group: two layers, then the maximum.

    The layers take features and relative position / radius. The first layer is linear in the
    neighbour's features and in the difference of positions, so it is evaluated once a source and
    once a centre and subtracted after grouping: the same numbers for a tenth of the products. Its
    inputs are normalised already, so only the second layer is, after the maximum, where the rows
    are few.
    """

    def __init__(self, inputs: int, hidden: int, outputs: int):
        super().__init__()
        self.features = nn.Linear(inputs, hidden)
        self.position = nn.Linear(3, hidden, bias=False)
        self.second = nn.Linear(hidden, outputs, bias=False)
        self.norm = nn.BatchNorm1d(outputs)

    def forward(self, x, position, centres, group):
        """Return features (S, outputs) of (rows, C) and positions over the radius (rows, 3)."""
        source = self.features(x) + self.position(position)
        grouped = torch.relu(source[group] - self.position(centres).unsqueeze(1))
        return torch.relu(self.norm(self.second(grouped).max(dim=1)[0]))


class FeaturePropagation(nn.Module):
    """Coarse features interpolated at finer points and joined with theirs, through a layer.

    The layer's coarse half is applied before interpolation, with which it commutes and where the
    rows are few.
    """

    def __init__(self, coarse: int, fine: int, outputs: int):
        super().__init__()
        self.coarse = nn.Linear(coarse, outputs, bias=False)
        self.fine = nn.Linear(fine, outputs, bias=False)
        self.norm = nn.BatchNorm1d(outputs)

    def forward(self, coarse, fine, index, weight):
        """Return features (S, outputs) at the finer points.

        Inputs are coarse (rows, C) and fine features (S, D), interpolation `index` and `weight` (S,
        3).
        """
        joined = (self.coarse(coarse)[index] * weight.unsqueeze(-1)).sum(dim=1) + self.fine(fine)
        return torch.relu(self.norm(joined))


class GlobalAbstraction(nn.Module):
    """The last set abstraction: one group of everything."""

    def __init__(self, inputs: int, hidden: int, outputs: int):
        super().__init__()
        self.first, self.second = Dense(inputs + 3, hidden), Dense(hidden, outputs)
        self.outputs = outputs

    def forward(self, x, position, size: int):
        y = self.second(self.first(torch.cat([x, position], dim=-1)))
        return y.reshape(-1, size, self.outputs).max(dim=1)[0]


class RoofNetwork(nn.Module):
    """Logits of every point (types, then not-roof) and of the type, by arranged clouds."""

    def __init__(self, settings: NetworkSettings):
        super().__init__()
        self.settings = settings
        widths, up_widths, classes = settings.widths, settings.up_widths, len(settings.types)
        inputs = [len(POINT_FEATURES), *(output for _, output in widths)]
        self.down = nn.ModuleList(SetAbstraction(inputs[i], *widths[i]) for i in range(3))
        self.everything = GlobalAbstraction(inputs[3], *widths[3])
        self.up = nn.ModuleList(
            [
                FeaturePropagation(inputs[3] + inputs[4], inputs[1], up_widths[0]),
                FeaturePropagation(up_widths[0], len(POINT_FEATURES), up_widths[1]),
            ]
        )
        self.dropout = nn.Dropout(settings.dropout)
        self.point_head = nn.Linear(up_widths[1], classes + 1)
        self.type_head = nn.Sequential(
            Dense(inputs[4], 96), nn.Dropout(settings.dropout), nn.Linear(96, classes)
        )
        self.register_buffer("metres", torch.tensor(POSITION_SCALE))

    def forward(
        self, features, group1, group2, group3, radii, up_index1, up_index2, up_weight1, up_weight2
    ):
        """Compute the logits; see `segment.arrange.Arrangement`.

        `features` (B N, 11), indices into flat rows, `radii` (B, 3). Returns point logits (B N,
        types + 1) and type logits (B, types).
        """
        sizes = (self.settings.layout.points, *self.settings.layout.levels)
        levels, position = [features], features[:, :3] * self.metres
        for i, (layer, group) in enumerate(zip(self.down, (group1, group2, group3), strict=True)):
            scaled = position.reshape(-1, sizes[i], 3) / radii[:, i].reshape(-1, 1, 1)
            centres = scaled[:, : sizes[i + 1]].reshape(-1, 3)
            levels.append(layer(levels[-1], scaled.reshape(-1, 3), centres, group))
            position = position.reshape(-1, sizes[i], 3)[:, : sizes[i + 1]].reshape(-1, 3)
        building = self.everything(levels[3], position / 10.0, sizes[3])
        surroundings = (
            building.unsqueeze(1).expand(-1, sizes[3], -1).reshape(-1, self.everything.outputs)
        )
        middle = self.up[0](
            torch.cat([levels[3], surroundings], dim=-1), levels[1], up_index1, up_weight1
        )
        fine = self.up[1](middle, levels[0], up_index2, up_weight2)
        return self.point_head(self.dropout(fine)), self.type_head(building)


def network_inputs(arrangements: list[Arrangement], layout: Layout) -> tuple[torch.Tensor, ...]:
    """Return the nine inputs of a batch of buildings in the order of INPUT_NAMES."""
    return tuple(
        torch.from_numpy(array) for array in stack_arrangements(arrangements, layout).values()
    )


def example_batch(layout: Layout) -> tuple[torch.Tensor, ...]:
    """Return inputs of one generic cloud, to trace the network with."""
    xyz = np.random.default_rng(0).uniform(0.0, 10.0, (2 * layout.points, 3))
    return network_inputs([arrange(xyz, layout)], layout)
