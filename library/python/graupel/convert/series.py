"""What all data sets hold of a run, its particle types, and the statistics of its motion."""
import dataclasses
import difflib

import numpy as np

from .errors import ConfigError, InputError

SPLITS = ("train", "valid", "test")
OBSTACLE, STATIONARY = 3, 13
# core/scene/material_config.h: word and particle type of each material, in its order.
MATERIALS = {"water": 5, "jelly": 4, "snow": 8, "sand": 6, "neo_hookean": 9, "metal": 10, "cake": 11, "toothpaste": 7,
             "foam": 12, "stationary": STATIONARY}
NAMES = {OBSTACLE: "obstacle", **{number: word for word, number in MATERIALS.items()}}
# GNS fixes 3, 5, 6 and 7, LagrangeBench 0 to 3; the others are free rows of their tables of nine, where Graupel keeps
# its own numbers. Rigid bodies (0 of GNS, 3 of LagrangeBench) are no material: users say what they are.
TABLES = {"gns": {3: 3, 4: 4, 5: 5, 6: 6, 7: 7, 8: 8},
          "lagrangebench": {0: 5, 1: 3, 2: 13, 4: 4, 6: 6, 7: 7, 8: 8}}
TABLES["tfrecord"] = TABLES["gns"]
LARGEST_WRITTEN = 8


@dataclasses.dataclass
class Series:
    """A run: position f32 [frames, particles, 2 or 3] in m, particle_type i64 [particles] of the file's format."""
    where: str
    position: np.ndarray
    particle_type: np.ndarray
    material_property: np.ndarray = None  # f32 [particles], what GNS stores beside the types

    @property
    def frames(self):
        return self.position.shape[0]

    @property
    def particles(self):
        return self.position.shape[1]

    @property
    def dimensions(self):
        return self.position.shape[2]


def name_of(number):
    return NAMES.get(number, f"type{number}")


class TypeTable:
    """Which material the particle types of another program are; `changes` are "5=water,6=obstacle"."""

    def __init__(self, form, changes=""):
        self.form = form
        self.ours = dict(TABLES[form])
        self.theirs = {ours: theirs for theirs, ours in self.ours.items()}
        for change in changes.split(",") if changes else []:
            self._change(change)

    def _change(self, text):
        number, sign, word = text.partition("=")
        if not sign or not number.isascii() or not number.isdigit() or int(number) >= 1 << 63:
            raise ConfigError(f"--types '{text}' is not NUMBER=MATERIAL. Example: --types 5=water,6=sand")
        words = ["obstacle", *MATERIALS]
        if word not in words:
            close = difflib.get_close_matches(word, words, 1)
            raise ConfigError(f"--types '{text}' names no material ('{word}', allowed: {', '.join(words)}). Use one of "
                              "these." + (f" Did you mean '{close[0]}'?" if close else ""))
        ours = OBSTACLE if word == "obstacle" else MATERIALS[word]
        self.ours[int(number)] = ours
        self.theirs[ours] = int(number)

    def to_ours(self, theirs, where):
        unknown = [int(t) for t in np.unique(theirs) if int(t) not in self.ours]
        if unknown:
            raise InputError(f"{where} has particles whose material is not known (types {', '.join(map(str, unknown))} of "
                             f"{self.form}). Say what they are, for instance --types "
                             + ",".join(f"{t}=jelly" for t in unknown))
        return mapped(theirs, self.ours)

    def to_theirs(self, ours, where):
        unknown = [name_of(int(t)) for t in np.unique(ours) if self.theirs.get(int(t), LARGEST_WRITTEN + 1) > LARGEST_WRITTEN]
        if unknown:
            raise InputError(f"{where} has particles that {self.form} has no type for ({', '.join(unknown)}). Choose "
                             "numbers from 0 to 8: --types " + ",".join(f"N={name}" for name in unknown))
        return mapped(ours, self.theirs)


def mapped(values, table):
    kinds, places = np.unique(values, return_inverse=True)
    return np.array([table[int(kind)] for kind in kinds], np.int64)[places]


def displacement(before, after, period):
    """The way [m] from one frame to the next, through a periodic wall where that is shorter; f64 [..., axes]."""
    way = after.astype(np.float64) - before.astype(np.float64)
    for axis in range(way.shape[-1]):
        if period[axis] > 0:
            turns = way[..., axis] / period[axis]
            way[..., axis] -= period[axis] * np.copysign(np.floor(np.abs(turns) + 0.5), turns)
    return way


class Moments:
    """Mean and standard deviation of each axis in double precision."""

    def __init__(self, axes):
        self.sum, self.square, self.count = np.zeros(axes), np.zeros(axes), 0

    def add_values(self, values):
        """values [n, axes]"""
        self.sum += values.sum(axis=0)
        self.square += (values * values).sum(axis=0)
        self.count += len(values)

    def mean(self):
        return self.sum * (1 / max(self.count, 1))

    def deviation(self):
        return np.sqrt(np.maximum(0.0, self.square / max(self.count, 1) - self.mean() * self.mean()))


class Motion:
    """Velocities x_t - x_(t-1) [m/frame] and accelerations v_(t+1) - v_t [m/frame^2] of particles that move by
    themselves."""

    def __init__(self, axes):
        self.velocity, self.acceleration = Moments(axes), Moments(axes)

    def add_series(self, position, types, period):
        """Types are ours."""
        free = (types != OBSTACLE) & (types != STATIONARY)
        last = None
        for t in range(1, len(position)):
            velocity = displacement(position[t - 1][free], position[t][free], period)
            self.velocity.add_values(velocity)
            if last is not None:
                self.acceleration.add_values(velocity - last)
            last = velocity

    def figures(self):
        return {"vel_mean": self.velocity.mean().tolist(), "vel_std": self.velocity.deviation().tolist(),
                "acc_mean": self.acceleration.mean().tolist(), "acc_std": self.acceleration.deviation().tolist()}
