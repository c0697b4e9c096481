"""Convolutions on the graph of a mesh, and residual blocks of them."""

import torch
from torch import nn

from meshot.types import Float, Int64, Tensor


class GraphConvolution(nn.Module):
    """For every vertex, one linear map of its own features plus the mean of another over its neighbours.

    Parameters
    ----------
    n_in, n_out : int
        Number of features.

    References
    ----------
    Wang et al., *Pixel2Mesh*, ECCV 2018; the mean over neighbours as in Bongratz et al., *Vox2Cortex*, CVPR 2022.
    """

    def __init__(self, n_in: int, n_out: int):
        super().__init__()
        self.own, self.others = nn.Linear(n_in, n_out), nn.Linear(n_in, n_out, bias=False)

    def forward(self, features: Float[Tensor, "v c"], edges: Int64[Tensor, "e 2"]) -> Float[Tensor, "v d"]:
        """The new features.

        Parameters
        ----------
        features : tensor
        edges : tensor
            Every edge once, as a pair of vertex indices.
        """
        sent, ends, starts = self.others(features), edges.flatten(), edges.flip(1).flatten()
        n_neighbours = torch.bincount(ends, minlength=len(features)).clamp(min=1).to(sent)
        return self.own(features) + torch.zeros_like(sent).index_add(0, ends, sent[starts]) / n_neighbours[:, None]


class ResidualGraphBlock(nn.Module):
    """Graph convolutions with ReLU, and the input added at the end, after a linear map if the widths differ.

    Every convolution is followed by a normalisation over the features of each vertex.

    Parameters
    ----------
    n_in, n_out : int
    n_layers : int
        Number of graph convolutions.
    """

    def __init__(self, n_in: int, n_out: int, n_layers: int = 2):
        super().__init__()
        self.layers = nn.ModuleList(GraphConvolution(n_in if k == 0 else n_out, n_out) for k in range(n_layers))
        self.norms = nn.ModuleList(nn.LayerNorm(n_out) for _ in range(n_layers))
        self.beside = nn.Linear(n_in, n_out) if n_in != n_out else nn.Identity()

    def forward(self, features: Float[Tensor, "v c"], edges: Int64[Tensor, "e 2"]) -> Float[Tensor, "v d"]:
        """The new features. The arguments are those of a graph convolution."""
        values = features
        for layer, norm in zip(self.layers, self.norms):
            last = layer is self.layers[-1]
            values = norm(layer(values, edges))
            values = values if last else nn.functional.relu(values)
        return nn.functional.relu(values + self.beside(features))
