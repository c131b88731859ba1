"""PyTorch: windows of data sets, and the hierarchical graph network (HGN) as a module with the shipped weights.

Importing graupel alone does not import torch.
"""
from .hgn import HGN
from .windows import WindowDataset

__all__ = ["HGN", "WindowDataset"]
