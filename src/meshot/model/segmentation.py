"""The segmentation network for white matter: a 3D U-Net."""

import numpy as np
import torch
from torch import nn

from meshot.errors import require_choice, require_positive_integer
from meshot.rng import Generator, numpy_generator
from meshot.types import PLACEMENTS, Float, Placement, Tensor

#: The classes of the output channels, in order.
CLASSES = ("background", "left", "right")
_KERNEL = 3


class SegmentationNetwork(nn.Module):
    """A 3D U-Net from a T1 to logits of background, left and right white matter.

    Every level has two 3 × 3 × 3 convolutions, each followed by instance normalisation and ReLU. Downsampling is by the
    maximum over 2 × 2 × 2 voxels, upsampling by nearest neighbours, with skip connections by concatenation. The number
    of channels doubles from level to level.

    Parameters
    ----------
    width : int
        Number of channels on the first level.
    depth : int
        Number of levels.
    fold : int
        The first level works on blocks of ``fold³`` voxels, whose values are stacked as channels. The output is
        unfolded again. No input is lost; with 2, nearly seven eighths of the computation are saved.
    placement : str
        How scans must be placed on the standard grid for this network: "grey values" or "white matter". It does not
        change what the network computes.
    generator : numpy.random.Generator, torch.Generator or int
        Source of the initial weights, normal with variance 2 / (number of inputs). Biases are initially zero.

    Raises
    ------
    ValueError
        If a count is not a positive integer, the last level would have more than 512 channels, or the placement is
        unknown.

    References
    ----------
    Çiçek et al., *3D U-Net: learning dense volumetric segmentation from sparse annotation*, MICCAI 2016; He et al.,
    *Delving deep into rectifiers*, ICCV 2015 (initial weights).
    """

    def __init__(
        self,
        width: int = 16,
        depth: int = 4,
        fold: int = 1,
        placement: Placement = PLACEMENTS[0],
        generator: Generator = 0,
    ):
        super().__init__()
        require_levels(width, depth, fold)
        require_choice(placement, "placement", PLACEMENTS)
        self.width, self.depth, self.fold, self.placement = width, depth, fold, placement
        widths = [width * 2**level for level in range(depth)]
        first = fold**3
        self.down = nn.ModuleList(_block(n_in, n_out) for n_in, n_out in zip([first, *widths], widths))
        self.up = nn.ModuleList(_block(n + 2 * n, n) for n in widths[:-1])
        self.head = nn.Conv3d(width, len(CLASSES) * first, _KERNEL, padding=1)
        initialise(self, generator)
        self.to(memory_format=torch.channels_last_3d)

    @property
    def multiple(self) -> int:
        """The number of voxels along every axis of an image must be a multiple of this."""
        return self.fold * 2 ** (self.depth - 1)

    def config(self) -> dict[str, int | str]:
        """The arguments that create a network of the same architecture. The first placement is left out."""
        placement = {} if self.placement == PLACEMENTS[0] else {"placement": self.placement}
        return {"width": self.width, "depth": self.depth, "fold": self.fold} | placement

    def forward(self, image: Float[Tensor, "b 1 x y z"]) -> Float[Tensor, "b 3 x y z"]:
        """Logits; softmax over the channels gives probabilities.

        Raises
        ------
        ValueError
            If an axis is not a multiple of :attr:`multiple`, or the coarsest level would be a single voxel.
        """
        shape = tuple(image.shape)
        if len(shape) != 5 or shape[1] != 1:
            raise ValueError(f"image has shape {shape}; (batch, 1, x, y, z) is needed: add axes with image[None, None]")
        if any(n % self.multiple for n in shape[2:]) or np.prod(shape[2:]) <= self.multiple**3:
            raise ValueError(
                f"image has {shape[2:]} voxels; each axis must be a multiple of {self.multiple} (fold {self.fold}, "
                f"depth {self.depth}), and one longer than that: pad or crop it, or take a network of less depth"
            )
        values = folded(image, self.fold).contiguous(memory_format=torch.channels_last_3d)
        levels = []
        for block in self.down:
            values = block(nn.functional.max_pool3d(values, 2) if levels else values)
            levels.append(values)
        for block, beside in zip(reversed(self.up), reversed(levels[:-1])):
            values = block(torch.cat([beside, nn.functional.interpolate(values, scale_factor=2)], dim=1))
        return unfolded(self.head(values), self.fold)


def require_levels(width: int, depth: int, fold: int) -> None:
    """Check the size of a U-Net. The limits are far above what can be stored, and prevent excessive memory use."""
    for name, count, most in (("width", width, 512), ("depth", depth, 10), ("fold", fold, 8)):
        require_positive_integer(count, name, most)
    require_positive_integer(width * 2 ** (depth - 1), "the width of the last level", 512)


def folded(values: Float[Tensor, "b c x y z"], fold: int) -> Float[Tensor, "b d i j k"]:
    """Blocks of ``fold³`` voxels stacked as channels: ``d = c · fold³``, and every axis is divided by ``fold``."""
    b, c, *shape = values.shape
    i, j, k = (n // fold for n in shape)
    blocks = values.reshape(b, c, i, fold, j, fold, k, fold).permute(0, 1, 3, 5, 7, 2, 4, 6)
    return blocks.reshape(b, c * fold**3, i, j, k)


def unfolded(values: Float[Tensor, "b d i j k"], fold: int) -> Float[Tensor, "b c x y z"]:
    """The inverse of :func:`meshot.model.folded`."""
    b, d, i, j, k = values.shape
    blocks = values.reshape(b, d // fold**3, fold, fold, fold, i, j, k).permute(0, 1, 5, 2, 6, 3, 7, 4)
    return blocks.reshape(b, d // fold**3, i * fold, j * fold, k * fold)


def _block(n_in: int, n_out: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for channels in (n_in, n_out):
        # No bias: the normalisation would remove it.
        layers += [nn.Conv3d(channels, n_out, _KERNEL, padding=1, bias=False)]
        layers += [nn.InstanceNorm3d(n_out, affine=True), nn.ReLU()]
    return nn.Sequential(*layers)


@torch.no_grad()
def initialise(network: nn.Module, generator: Generator) -> None:
    """Draw the weights of all convolutions and linear layers: normal with variance 2 / (number of inputs), no biases.

    References
    ----------
    He et al., *Delving deep into rectifiers*, ICCV 2015.
    """
    generator = numpy_generator(generator)
    for layer in network.modules():
        if isinstance(layer, (nn.Conv3d, nn.Linear)):
            scale = np.sqrt(2 / layer.weight[0].numel())
            layer.weight.copy_(torch.from_numpy(scale * generator.standard_normal(tuple(layer.weight.shape))))
            if layer.bias is not None:
                layer.bias.zero_()


# Overlap and cross-entropy between predicted class probabilities and true volume fractions of voxels.


def soft_dice(first: Float[Tensor, "c *shape"], second: Float[Tensor, "c *shape"]) -> Float[Tensor, " c"]:
    """The overlap 2 Σ a b / (Σ a² + Σ b²) of two maps, per channel, in [0, 1] for values >= 0.

    It is 1 if and only if both maps are equal, including partial volumes. For masks it is the Dice coefficient. With
    Σ a + Σ b in the denominator, the optimum for a half-filled voxel would be 0 or 1. For two empty maps it is 1.

    Raises
    ------
    ValueError
        If the shapes differ.

    References
    ----------
    Milletari et al., *V-Net: fully convolutional neural networks for volumetric medical image segmentation*, 2016.
    """
    if first.shape != second.shape:
        raise ValueError(f"the maps have shapes {tuple(first.shape)} and {tuple(second.shape)}; they must agree")
    first, second = first.flatten(1), second.flatten(1)
    total = (first.square() + second.square()).sum(dim=1)
    empty = total == 0
    return torch.where(empty, 1.0, 2 * (first * second).sum(dim=1) / torch.where(empty, 1.0, total))


def segmentation_loss(
    logits: Float[Tensor, "b 3 x y z"], fractions: Float[Tensor, "b 2 x y z"], dice_weight: float = 1.0
) -> Float[Tensor, ""]:
    """Cross-entropy, averaged over voxels, plus ``dice_weight`` times one minus the mean soft Dice of both sides.

    Both terms are minimal where the predicted probabilities equal the fractions. Dice is computed over the whole batch.

    Parameters
    ----------
    logits : tensor
        Logits of background, left and right.
    fractions : tensor
        The fractions of each voxel that are left and right white matter; the rest is background. Masks are allowed.
    dice_weight : float
        At least 0.

    Raises
    ------
    ValueError
        If the grids differ, or the weight is negative.
    """
    if logits.shape[0] != fractions.shape[0] or logits.shape[2:] != fractions.shape[2:]:
        raise ValueError(
            f"logits have shape {tuple(logits.shape)}, fractions {tuple(fractions.shape)}; batch and grid must agree"
        )
    if not dice_weight >= 0:
        raise ValueError(f"dice_weight is {dice_weight!r}; a number >= 0 is needed")
    above = logits[:, 1:] - logits[:, :1]  # relative to the background, whose own term then vanishes
    spread = torch.logsumexp(logits, dim=1, keepdim=True) - logits[:, :1]
    entropy = spread.mean() - (fractions * above).sum() / spread.numel()
    overlap = soft_dice((above - spread).exp().transpose(0, 1), fractions.transpose(0, 1))
    return entropy + dice_weight * (1 - overlap.mean())
