"""A pilot whose candidates are made up, with planted variances and seconds."""

from types import SimpleNamespace

import numpy as np
from pictures import box, gridded, picture, volume

from clvol.lab import pilot as pilots
from clvol.lab.candidates import Candidate
from clvol.lab.seeds import independent_seeds
from clvol.scene.records import ConstantEmitter, DirectionalEmitter

CUBE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
SKY, SUN = ConstantEmitter(), DirectionalEmitter((2.0,), (0.0, -1.0, 0.0))


def scene(medium, lights):
    return picture([box(*CUBE, medium)], lights, (0.4, 0.5, -3.0), (0.5, 0.5, 0.5), 30.0, (16, 16))


def lumps(scale=(3.0,)):
    return gridded(volume(np.random.default_rng(1).random((5, 6, 7)), *CUBE), 0.7, scale=scale)


FACTORS = {
    "technique": {"decomposition": 3.0, "regular": 0.05},
    "transmittance": {"power-series": 2.0, "delta": 0.6},
    "majorant": {"kdtree": 2.0, "global": 0.7},
}
"""Planted efficiencies; 1 for others."""


class MadeUpPilot(pilots.Pilot):
    """A pilot whose candidates are made up: no device, no kernels; seconds are planted, work is counted."""

    factors = FACTORS
    rendered = 0
    stage = ""

    def slowness(self, stage, auto):
        """Multiplies the seconds of a round."""
        return 1.0

    def _stage(self, family, best, auto):
        self.stage = family
        return super()._stage(family, best, auto)

    def _confirmed(self, best, auto):
        self.stage = "final"
        return super()._confirmed(best, auto)

    def _open(self, choices):
        plan = self.plan.having(choices)
        if plan.chosen["majorant"] == "auto":
            plan = plan.renamed(majorant="grid")
        used = {family: plan.chosen[family] for family in pilots.CHOSEN}
        session = SimpleNamespace(plan=plan)
        trial = SimpleNamespace(session=session, choices=choices, names=used, precompute_seconds=0.0)
        candidate = Candidate(" + ".join(used.values()), trial)
        efficiency = np.prod([self.factors[f].get(n, 1.0) for f, n in used.items()])

        def render(seed, spp):
            rng = np.random.default_rng(seed)
            candidate.images.append(rng.normal(1.0, 0.1, (16, 16, 3)))
            slowness = self.slowness(self.stage, candidate is self.candidates[0])
            candidate.seconds.append(0.02 / efficiency * slowness)
            self.__class__.rendered += 1

        candidate.render = render
        self.candidates.append(candidate)
        return candidate

    def _fits(self, candidate):
        return True


def made_up(choices, medium=None, factors=FACTORS, **members):
    lit = scene(medium or lumps(), (SKY, SUN))
    kind = type("Made", (MadeUpPilot,), {"factors": factors} | members)
    run = kind(None, lit, choices, independent_seeds(0, "pilot"), 64, None, None, True)
    return run.found(), run
