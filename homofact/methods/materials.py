"""The data for trying mixes: the log samples of one material, or of several that share their projections.

Several materials share the projections, but each has its own textures. For given projections each has its own inner
problem, so the objective is the mean of the materials' objectives, R(P) = Σk Rk(P)/K, and its gradient the mean of
their gradients. A mix is judged by the mean of their left-out errors. One material is the case K = 1.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.factor.objective import JointObjective, Objective
from homofact.factor.projection import Projection
from homofact.factor.textures import LogSamples, Smoothing
from homofact.linear.layout import Shape
from homofact.methods.effort import cost_of_evaluation
from homofact.methods.folded import FixedBank, Folded, JointFolded
from homofact.methods.validation import Partition


@dataclass(frozen=True)
class TrainingMaterial:
    """One material's log samples and their partitions into folds."""

    samples: LogSamples
    partitions: tuple[Partition, ...]

    def drawn(self, count: int, seed: int) -> "TrainingMaterial":
        """Return at most `count` samples, drawn by `seed`, in their original order; 0 means all."""
        if not 0 < count < len(self.samples.logs):
            return self
        chosen = torch.randperm(len(self.samples.logs), generator=torch.Generator().manual_seed(seed))
        chosen = chosen[:count].sort().values
        return TrainingMaterial(self.samples.select(chosen), tuple(own.select(chosen) for own in self.partitions))


@dataclass(frozen=True)
class Materials:
    """One material, or several that share their projections."""

    materials: tuple[TrainingMaterial, ...]

    @property
    def samples(self) -> int:
        """How many samples all of them have."""
        return sum(len(material.samples.logs) for material in self.materials)

    def drawn(self, count: int, seed: int) -> "Materials":
        """At most `count` samples of each, as `TrainingMaterial.drawn`."""
        return Materials(tuple(material.drawn(count, seed) for material in self.materials))

    def cost(self, lookups: int, unknowns: int) -> float:
        """Return units of one evaluation of all of them (`effort.cost_of_evaluation`)."""
        return sum(cost_of_evaluation(len(material.samples.logs), lookups, unknowns) for material in self.materials)

    def objective(
        self, projections: tuple[Projection, ...], shapes: tuple[Shape, ...], smoothing: Smoothing, bound: str
    ) -> JointObjective:
        """Return the reduced objective of textures of these shapes, as a function of the projections."""
        own = (Objective(material.samples, projections, shapes, smoothing, bound) for material in self.materials)
        return JointObjective(tuple(own))

    def folded(
        self, projections: tuple[Projection, ...], shapes: tuple[Shape, ...], most: int | None = None
    ) -> JointFolded:
        """Return the equations fold by fold, as `Folded.of`."""
        return JointFolded(
            tuple(
                Folded.of(material.samples, material.partitions, projections, shapes, most)
                for material in self.materials
            )
        )

    def bank(self, projections: tuple[Projection, ...], shapes: tuple[Shape, ...]) -> "Banks":
        """Fixed projections accumulated together, as `FixedBank.of`."""
        own = (FixedBank.of(material.samples, material.partitions, projections, shapes) for material in self.materials)
        return Banks(projections, tuple(own))

    def digested(self) -> tuple[Tensor, ...]:
        """Return every tensor of them, for a digest."""
        tensors: list[Tensor] = []
        for own in self.materials:
            tensors += [own.samples.wi, own.samples.wo, own.samples.logs, own.samples.weights]
            tensors += [partition.folds for partition in own.partitions]
        return tuple(tensors)


@dataclass(frozen=True)
class Banks:
    """A bank of every material for the same fixed projections."""

    projections: tuple[Projection, ...]
    banks: tuple[FixedBank, ...]

    def mix(self, chosen: tuple[int, ...]) -> JointFolded:
        """Return the equations of the projections at `chosen`, in that order."""
        return JointFolded(tuple(bank.mix(chosen) for bank in self.banks))
