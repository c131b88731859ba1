"""Windows of positions of a data set, read when they are asked for."""
from __future__ import annotations

import os
from bisect import bisect_right
from itertools import accumulate

import numpy
import torch

from .. import _graupel
from .._errors import ConfigError, InputError


def _file_of(path, split):
    path = os.fsdecode(path)
    if not os.path.isdir(path):
        return path
    file = os.path.join(path, f"{split}.h5")
    if not os.path.isfile(file):
        raise InputError(f"the data set '{path}' has no '{split}.h5'. Choose another split (train, valid, test)")
    return file


class WindowDataset(torch.utils.data.Dataset):
    """Every run of `history + 1 + predicted` frames of a data set.

    dataset[i] is a dict: 'positions' f32 [history + 1 + predicted, n, 3] m; 'particle_types' i64 [n]; 'materials' i64
    [n], places in the sorted names of the scene's materials, -1 for none; 'trajectory' and 'frame', the number of the
    trajectory and of the window's first frame; 'active' bool like positions without its last axis, where particles come
    or go. Particle numbers differ from trajectory to trajectory: use batch_size=None, or a collate_fn of your own.

    The file is opened again in every worker process of a DataLoader. HDF5 is read by one thread at a time; workers read
    at once. Where other threads read files of Graupel, use multiprocessing_context='spawn': a process that is forked
    meanwhile waits forever for their locks.
    """

    def __init__(self, path, split: str = "train", *, history: int = 5, predicted: int = 1, stride: int = 1):
        """path: a file, or the folder of `graupel generate`. stride: frames between the starts of windows.

        Raises InputError for what is no data set, ConfigError for windows that no trajectory has.
        """
        if history < 0 or predicted < 0 or stride < 1:
            raise ConfigError(f"windows of history {history}, predicted {predicted}, stride {stride} are not possible "
                              "(allowed: at least 0, 0, 1)")
        self.file, self.length, self.stride = _file_of(path, split), history + 1 + predicted, stride
        self._data, self._static, self._process = None, {}, None
        counts = []
        for trajectory in self._open():
            end = trajectory.diverged_at_frame
            frames = len(trajectory) if end < 0 else min(end, len(trajectory))
            counts.append(max(0, (frames - self.length) // stride + 1))
        if not any(counts):
            raise ConfigError(f"no trajectory of '{self.file}' has a window of {self.length} frames. Use a shorter one")
        self._ends = list(accumulate(counts))

    def __getstate__(self):
        return {**self.__dict__, "_data": None, "_static": {}, "_process": None}

    def _open(self):
        if self._process != os.getpid():  # a forked one has its parent's
            self._data, self._static, self._process = _graupel.open(self.file), {}, os.getpid()
        return self._data

    def _of_trajectory(self, number):
        """A trajectory with its types and materials."""
        data = self._open()
        if number not in self._static:
            trajectory = data[number]
            self._static[number] = (trajectory, torch.from_numpy(trajectory.particle_types.astype(numpy.int64)),
                                    torch.from_numpy(trajectory.particle_materials.astype(numpy.int64)))
        return self._static[number]

    def __len__(self):
        return self._ends[-1]

    def __getitem__(self, index):
        place = index + len(self) if index < 0 else index
        if not 0 <= place < len(self):
            raise IndexError(f"window {index} of {len(self)}")
        number = bisect_right(self._ends, place)
        first = (place - (self._ends[number - 1] if number else 0)) * self.stride
        trajectory, types, materials = self._of_trajectory(number)
        item = {"positions": torch.from_numpy(trajectory.positions[first:first + self.length]),
                "particle_types": types.clone(), "materials": materials.clone(), "trajectory": number, "frame": first}
        if trajectory.has_active:
            item["active"] = torch.from_numpy(trajectory.active[first:first + self.length].astype(bool))
        return item
