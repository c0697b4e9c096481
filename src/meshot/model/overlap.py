"""Overlap and cross-entropy between predicted class probabilities and true volume fractions of voxels."""

import torch

from meshot.types import Float, Tensor


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
