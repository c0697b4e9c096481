"""Image features at several resolutions: a 3D U-Net that returns all its maps, and their values at points in mm."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import nn

from meshot.model.segmentation import folded, initialise, require_levels
from meshot.rng import Generator
from meshot.types import Float, Int64, Tensor
from meshot.volume import Volume, mm_to_voxel

SLOPE = 0.2  # slope of the leaky ReLU for negative values


class FeatureNetwork(nn.Module):
    """A 3D U-Net, or its encoder alone, whose maps at all resolutions are the result.

    Every level has two 3 × 3 × 3 convolutions, each followed by instance normalisation and leaky ReLU. Downsampling is
    by the maximum over 2 × 2 × 2 voxels, upsampling by nearest neighbours, with skip connections by concatenation.

    Parameters
    ----------
    width : int
        Number of channels on the first level. It doubles from level to level.
    depth : int
        Number of levels.
    fold : int
        The first level works on blocks of ``fold³`` voxels, whose values are stacked as channels.
    n_more : int
        Number of input channels, beside the image, on the grid of the first level.
    residual : bool
        Whether the input of every level is added to its output, after a 1 × 1 × 1 convolution.
    decoder : bool
        Whether the levels upwards exist. Without them, the network is the encoder alone.
    generator : generator or int
        Source of the initial weights.

    Raises
    ------
    ValueError
        If a count is not a positive integer, or the last level would have more than 512 channels.

    References
    ----------
    Çiçek et al., *3D U-Net*, MICCAI 2016; Zhang et al., *Road extraction by deep residual U-Net*, 2018.
    """

    def __init__(
        self,
        width: int = 8,
        depth: int = 3,
        fold: int = 2,
        n_more: int = 0,
        residual: bool = False,
        decoder: bool = True,
        generator: Generator = 0,
    ):
        super().__init__()
        require_levels(width, depth, fold)
        self.fold, self.depth = fold, depth
        widths = [width * 2**level for level in range(depth)]
        first = fold**3 + n_more
        self.down = nn.ModuleList(_Level(n_in, n, residual) for n_in, n in zip([first, *widths], widths))
        up = [_Level(n + 2 * n, n, residual) for n in widths[:-1]] if decoder else []
        self.up = nn.ModuleList(up)
        self.widths = (*widths, *(reversed(widths[:-1]) if decoder else ()))
        initialise(self, generator)

    @property
    def multiple(self) -> int:
        """The number of voxels along every axis of an image must be a multiple of this."""
        return self.fold * 2 ** (self.depth - 1)

    def forward(self, image: Float[Tensor, "1 1 x y z"], more: Tensor | None = None) -> list[Tensor]:
        """The maps of the encoder from fine to coarse, then those of the decoder from coarse to fine.

        Their numbers of channels are ``widths``. The first and the last have the grid of the first level.

        Raises
        ------
        ValueError
            If an axis of the image is not a multiple of :attr:`multiple`, or is too short.
        """
        shape = tuple(image.shape[2:])
        if any(n % self.multiple or n <= self.multiple for n in shape):
            raise ValueError(
                f"image has {shape} voxels; each axis must be a multiple of {self.multiple} (fold {self.fold}, depth "
                f"{self.depth}), and longer: pad or crop it, or take a network of less depth"
            )
        values = folded(image, self.fold)
        values = values if more is None else torch.cat([values, more], dim=1)
        found: list[Tensor] = []
        for level in self.down:
            values = level(nn.functional.max_pool3d(values, 2) if found else values)
            found.append(values)
        for level, beside in zip(reversed(self.up), reversed(found[:-1])):
            values = level(torch.cat([beside, nn.functional.interpolate(values, scale_factor=2)], dim=1))
            found.append(values)
        return found


class _Level(nn.Module):
    def __init__(self, n_in: int, n_out: int, residual: bool):
        super().__init__()
        # No bias: the normalisation would remove it.
        self.first = nn.Conv3d(n_in, n_out, 3, padding=1, bias=False)
        self.second = nn.Conv3d(n_out, n_out, 3, padding=1, bias=False)
        self.norms = nn.ModuleList(nn.InstanceNorm3d(n_out, affine=True) for _ in range(2))
        self.beside = nn.Conv3d(n_in, n_out, 1) if residual else None

    def forward(self, values: Tensor) -> Tensor:
        inner = nn.functional.leaky_relu(self.norms[0](self.first(values)), SLOPE)
        outer = self.norms[1](self.second(inner))
        return nn.functional.leaky_relu(outer if self.beside is None else outer + self.beside(values), SLOPE)


def sample_features(
    maps: Sequence[Float[Tensor, "1 _ _ _ _"]], image: Volume, points: Float[Tensor, "n 3"]
) -> Float[Tensor, "n c"]:
    """The values of feature maps at points, by trilinear interpolation, side by side.

    Differentiable in the maps and in the points. Outside the image the value is that at its border.

    Parameters
    ----------
    maps : sequence of tensor
        Each covers the whole image, with voxels of any size.
    image : Volume
        The image from which the maps were computed. Only its grid is used.
    points : tensor
        In mm.
    """
    shape = points.new_tensor(image.data.shape)
    # From -1 to 1 between the outer sides of the first and the last voxel, whatever the size of the voxels of a map.
    places = (2 * (mm_to_voxel(image, points) + 0.5) / shape - 1).flip(1)[None, None, None]
    found = [
        nn.functional.grid_sample(each, places.to(each), padding_mode="border", align_corners=False)[0, :, 0, 0].T
        for each in maps
    ]
    return torch.cat(found, dim=1)


# Convolutions on the graph of a mesh, and residual blocks of them.


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
        """The new features. The edges are pairs of vertex indices, every edge once."""
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


# Images of several scales in one tensor, from which all cubes around points are cut at once.


class StackedImages:
    """Images of several scales on one device, each with a border of zeros, one after the other in a flat tensor."""

    # A cube around a point needs the voxels at whole distances from it, each interpolated with the same weights. So the
    # (size + 1)³ voxels around are taken once. Interpolation and convolution are both linear. The convolution comes
    # first (:meth:`meshot.model.deformation.CubeConvolution.cut`), as one matrix product: interpolated cubes are never
    # stored.

    def __init__(self, images: tuple[Volume, ...], size: int, like: Tensor):
        half = size // 2
        self.size, self.margin = size, half + 1
        padded = [np.pad(image.data, self.margin + half) for image in images]
        self.values = torch.cat([torch.from_numpy(np.ascontiguousarray(each)).to(like).flatten() for each in padded])
        shapes = np.array([each.shape for each in padded])
        strides = np.stack([shapes[:, 1] * shapes[:, 2], shapes[:, 2], np.ones(len(images), np.int64)], axis=1)
        starts = np.cumsum([0, *(each.size for each in padded)])[:-1]
        around = np.array(list(np.ndindex(*[size + 1] * 3)))
        self.starts = torch.from_numpy(starts)[:, None].to(like.device)  # (scales, 1)
        self.strides = torch.from_numpy(strides)[:, None].to(like.device)  # (scales, 1, 3)
        self.around = torch.from_numpy(strides @ around.T)[:, None].to(like.device)  # (scales, 1, (size + 1)³)
        #: The last place whose cubes are inside; a cube there has no voxel of the image.
        self.last = torch.from_numpy(shapes - 2 * half - 1)[:, None].to(like)
        to_voxels = np.stack([np.linalg.inv(image.affine) for image in images])
        self.turn = torch.from_numpy(to_voxels[:, :3, :3].transpose(0, 2, 1).copy()).to(like)
        self.shift = torch.from_numpy(to_voxels[:, None, :3, 3] + self.margin).to(like)

    def corners(
        self, points: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "scales n voxels"], Float[Tensor, "scales n 8"]]:
        """The voxels around points in mm, zero outside the image, and the weights of the eight cubes among them."""
        # A cube around a point is the weighted sum of the eight cubes of (size)³ voxels that begin at the corners of
        # the first voxel, in the order of ``np.ndindex(2, 2, 2)``. The weights are those of trilinear interpolation,
        # and differentiable in the points.
        # Distant points are clipped to the border, where all cubes are zero.
        places = torch.minimum((points @ self.turn + self.shift).clamp(min=0), self.last)
        lower = torch.minimum(places.detach().nan_to_num().floor(), self.last - 1)
        shares = torch.stack([lower + 1 - places, places - lower], dim=3)  # (scales, n, 3, 2)
        x, y, z = shares.unbind(dim=2)
        weights = x[..., :, None, None] * y[..., None, :, None] * z[..., None, None, :]
        first = (lower.long() * self.strides).sum(dim=2) + self.starts
        return self.values[first[..., None] + self.around], weights.flatten(2)
