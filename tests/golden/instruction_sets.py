"""Instruction sets of this machine that the program can be told to use, and its kinds of products."""

import platform


def _flags():
    if platform.machine() not in ("x86_64", "AMD64"):
        return set()
    with open("/proc/cpuinfo") as file:
        return next((set(line.split(":", 1)[1].split()) for line in file if line.startswith("flags")), set())


def instruction_sets():
    """Words of GRAUPEL_SIMD."""
    flags, sets = _flags(), ["baseline"]
    if {"avx2", "fma", "bmi2"} <= flags:
        sets.append("avx2")
        if {"avx512f", "avx512dq", "avx512bw", "avx512vl", "avx512cd"} <= flags:
            sets.append("avx512")
    return sets


def product_kinds():
    """Words of GRAUPEL_PRODUCTS."""
    flags, kinds = _flags(), ["f32"]
    if "avx512_bf16" in flags:
        kinds.append("bf16-vectors")
    if "amx_bf16" in flags:
        kinds.append("bf16")
    return kinds


def arithmetic():
    """(name, environment) of every instruction set with products in f32, and of the best set with the others."""
    sets, kinds = instruction_sets(), product_kinds()
    made = [(f"{name}+f32", {"GRAUPEL_SIMD": name, "GRAUPEL_PRODUCTS": "f32"}) for name in sets]
    return made + [(f"{sets[-1]}+{kind}", {"GRAUPEL_SIMD": sets[-1], "GRAUPEL_PRODUCTS": kind}) for kind in kinds[1:]]
