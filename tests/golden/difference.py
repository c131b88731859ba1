"""Holds named arrays of two builds against each other: equal bits, or the largest difference with its place and unit."""

from dataclasses import dataclass

import numpy as np


@dataclass
class Difference:
    """Of one array. `excess`: largest difference over what is allowed (0: equal bits); above 1 it fails."""
    name: str
    text: str
    excess: float
    largest: float = 0.0
    unit: str = ""
    place: str = ""


def place_of(index, axes):
    return ", ".join(f"{axes[i] if i < len(axes) else 'axis %d' % i} {int(k)}" for i, k in enumerate(index))


def difference_of(name, reference, new, tolerance, relative):
    """`tolerance`: for positions, in metres; `relative`: for the rest, of the array's largest value. 0: equal bits."""
    a, b = np.asarray(reference.array), np.asarray(new.array)
    if a.shape != b.shape or a.dtype != b.dtype:
        return Difference(name, f"{name}: {a.dtype}{list(a.shape)} became {b.dtype}{list(b.shape)}", np.inf, np.inf)
    if a.tobytes() == b.tobytes():
        return None
    if a.dtype.kind not in "fiub":
        return Difference(name, f"{name}: not the same bytes", np.inf, np.inf)
    wide_a, wide_b = a.astype(np.float64), b.astype(np.float64)
    with np.errstate(invalid="ignore"):
        distance = np.abs(wide_a - wide_b)
    both = np.isnan(wide_a) & np.isnan(wide_b)
    distance = np.where(both, 0.0, np.where(np.isnan(distance) & ~both, np.where(wide_a == wide_b, 0.0, np.inf), distance))
    index = np.unravel_index(int(np.argmax(distance)), distance.shape)
    largest = float(distance[index])
    if largest == 0.0:  # other bits of equal numbers: a zero of another sign, another NaN
        bits = np.dtype(f"u{a.dtype.itemsize}")
        unlike = np.ascontiguousarray(a).view(bits) != np.ascontiguousarray(b).view(bits)
        index = np.unravel_index(int(np.argmax(unlike)), unlike.shape)
    if reference.kind == "position":
        allowed = tolerance
    else:
        finite = np.abs(wide_a[np.isfinite(wide_a)])
        allowed = relative * (float(finite.max()) if finite.size else 0.0)
    if a.dtype.kind == "f" and allowed > 0:  # numbers that lie close may be stored one step apart
        allowed += float(np.spacing(np.abs(a[index])))
    excess = largest / allowed if allowed > 0 else np.inf
    place = place_of(index, reference.axes)
    text = f"{name}: {largest:.3g}{' ' + reference.unit if reference.unit else ''} at {place} ({a[index]!s} became {b[index]!s})"
    return Difference(name, text, excess, largest, reference.unit, place)


def differences(reference, new, tolerance=0.0, relative=0.0):
    """Of two dictionaries of Values, the worst first. What the new one has beside is no difference."""
    found = []
    for name, values in reference.items():
        if name not in new:
            found.append(Difference(name, f"{name} is missing", np.inf, np.inf))
            continue
        difference = difference_of(name, values, new[name], tolerance, relative)
        if difference:
            found.append(difference)
    return sorted(found, key=lambda d: (-d.excess, not d.name.endswith("position"), d.name))
