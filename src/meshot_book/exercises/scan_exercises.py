"""Chapter 36: handles from faces, FreeSurfer's surface space, and simple points in the plane."""

import itertools

import numpy as np
import scipy.ndimage
import torch

from meshot.mesh import icosphere
from meshot.types import Float, Int64, Tensor
from meshot_book.exercises.verdict import Case, Mistake, check_answer


def handles(function: object) -> None:
    """Check ``function(faces)``: how many handles a closed, connected surface has, from its faces alone."""
    mistakes = [
        Mistake(_euler, "this is the Euler number χ itself; each handle lowers it by two: χ = 2 − 2 g"),
        Mistake(lambda f: 2 - _euler(f), "this is 2 − χ; each handle accounts for two of it"),
        Mistake(lambda f: (_euler(f) - 2) // 2, "the sign is wrong: more handles give a smaller χ"),
        Mistake(
            lambda f: (2 - (len(f.unique()) - 3 * len(f) + len(f))) // 2,
            "every edge is counted once for each of its two faces; count each pair of vertices once",
        ),
        Mistake(
            lambda f: (2 - (len(f.unique()) - len(torch.unique(_sides(f), dim=0)) + len(f))) // 2,
            "(a, b) and (b, a) are the same edge; sort each pair before you count what is unique",
        ),
        Mistake(
            lambda f: (2 - (int(f.max()) + 1 - len(_edges(f)) + len(f))) // 2,
            "the numbers may have gaps; count only the vertices that occur in faces",
        ),
    ]
    sphere, ring = icosphere(1).faces, _ring(5, 4)
    cases = [
        Case("a sphere", (sphere,)),
        Case("a tetrahedron", (torch.tensor([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]),)),
        Case("a torus", (ring,)),
        Case("a torus of another size", (_ring(3, 7),)),
        Case("a torus whose vertices are numbered with gaps", (3 * ring + 10,)),
        Case("a ring with two holes", (_two_holes(),)),
    ]
    check_answer(function, lambda f: (2 - _euler(f)) // 2, cases, mistakes, "handles")


def _sides(faces: Int64[Tensor, "F 3"]) -> Int64[Tensor, "S 2"]:
    return torch.cat([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def _edges(faces: Int64[Tensor, "F 3"]) -> Int64[Tensor, "E 2"]:
    return torch.unique(_sides(faces).sort(dim=1).values, dim=0)


def _euler(faces: Int64[Tensor, "F 3"]) -> int:
    return len(faces.unique()) - len(_edges(faces)) + len(faces)


def _ring(n: int, m: int) -> Int64[Tensor, "F 3"]:
    corner = torch.arange(n * m).reshape(n, m)
    right, up = corner.roll(-1, 0), corner.roll(-1, 1)
    both = right.roll(-1, 1)
    return torch.cat([torch.stack([corner, right, both], -1), torch.stack([corner, both, up], -1)]).reshape(-1, 3)


def _two_holes() -> Int64[Tensor, "F 3"]:
    """Two tori, a face cut out of each, sewn together along the three edges (reversed on one side)."""
    first = _ring(4, 5)
    second = _ring(5, 5) + 20
    (a, b, c), (x, y, z) = first[0].tolist(), second[0].tolist()
    sewn = second[1:].clone()
    for old, new in ((x, a), (y, c), (z, b)):
        sewn[second[1:] == old] = new
    return torch.cat([first[1:], sewn])


def surface_ras(function: object) -> None:
    """Check ``function(points_mm, affine, shape)``: scanner RAS to the surface RAS of a conformed FreeSurfer volume."""
    mistakes = [
        Mistake(lambda p, a, s: p + _centre(a, s), "c_ras is added; that maps surface RAS to scanner RAS, the inverse"),
        Mistake(
            lambda p, a, s: p - _centre(a, [n - 1 for n in s]),
            "FreeSurfer's centre is at half the *number* of voxels, not at half the last index",
        ),
        Mistake(
            lambda p, a, s: p - a[:3, :3] @ _half(s),
            "the last column of the affine is missing; map the centre with the whole affine",
        ),
        Mistake(lambda p, a, s: p - a[:3, 3], "this moves the first voxel to the origin; the centre must move there"),
        Mistake(
            lambda p, a, s: (p - a[:3, 3]) @ torch.linalg.inv(a[:3, :3]).T - _half(s),
            "these are voxels counted from the centre; surface RAS stays in mm, along the scanner's axes",
        ),
        Mistake(lambda p, a, s: p, "unchanged: right only for a scan that is centred at the origin"),
    ]
    points = torch.from_numpy(np.random.default_rng(0).normal(scale=30, size=(6, 3)))
    plain = torch.tensor([[1.0, 0, 0, -98], [0, 1, 0, -134], [0, 0, 1, -72], [0, 0, 0, 1]], dtype=torch.float64)
    flipped = torch.tensor([[-1.0, 0, 0, 90], [0, 0, 1.2, -80], [0, -1, 0, 110], [0, 0, 0, 1]], dtype=torch.float64)
    oblique = torch.tensor([[0.8, 0.6, 0, -60], [-0.6, 0.8, 0, 20], [0, 0, 2, -50], [0, 0, 0, 1]], dtype=torch.float64)
    cases = [
        Case("a scan with plain axes", (points, plain, (197, 233, 189))),
        Case("a scan with flipped axes", (points, flipped, (256, 160, 256))),
        Case("an oblique scan", (points, oblique, (120, 140, 61))),
        Case("one point", (points[:1], oblique, (10, 20, 30))),
    ]
    check_answer(function, lambda p, a, s: p - _centre(a, s), cases, mistakes, "surface_ras")


def _half(shape: tuple[int, ...] | list[int]) -> Float[Tensor, " 3"]:
    return torch.tensor(shape, dtype=torch.float64) / 2


def _centre(affine: Float[Tensor, "4 4"], shape: tuple[int, ...] | list[int]) -> Float[Tensor, " 3"]:
    return affine[:3, :3] @ _half(shape) + affine[:3, 3]


def is_simple(function: object) -> None:
    """Check ``function(neighbourhood)``: may the middle of a 3 × 3 mask be added without changing the topology?

    Pixels of the object hang together by edges and corners (8), those of the background by edges (4).
    """
    mistakes = [
        Mistake(
            lambda n: 0 < _ring_of(n).sum() < 8, "a pixel with some neighbours may still close a ring or join two parts"
        ),
        Mistake(
            lambda n: _count(n, 8)[0] == 1,
            "one part of the object around is not enough: a pixel in the middle of a ring fills a hole",
        ),
        Mistake(
            lambda n: _count(n, 4)[0] == 1, "object pixels are also connected through corners: 8 neighbours, not 4"
        ),
        Mistake(
            lambda n: _count(n, 8)[0] == 1 and _count(n, 8)[1] == 1,
            "the background is connected through edges only: 4 neighbours, not 8",
        ),
        Mistake(
            lambda n: _count(n, 8)[0] == 1 and _loose_background(n) == 1,
            "a background pixel at a corner does not touch the middle; count only parts that share an edge with it",
        ),
    ]
    cases = []
    for values in itertools.product((False, True), repeat=8):
        mask = torch.tensor([*values[:4], False, *values[4:]]).reshape(3, 3)
        drawn = " / ".join("".join(".#"[int(v)] for v in row) for row in mask)
        cases.append(Case(f"the neighbourhood {drawn}", (mask,)))
    check_answer(function, _is_simple, cases, mistakes, "is_simple")


def _ring_of(mask: Tensor) -> Tensor:
    return mask.flatten()[[0, 1, 2, 3, 5, 6, 7, 8]]


def _count(mask: Tensor, object_neighbours: int) -> tuple[int, int]:
    """Parts of the object around the middle, and parts of the background that touch it with the other adjacency."""
    around = mask.numpy().copy()
    around[1, 1] = False
    structure = {4: None, 8: np.ones((3, 3))}
    _, n_object = scipy.ndimage.label(around, structure[object_neighbours])
    background = ~around
    background[1, 1] = False
    labels, _ = scipy.ndimage.label(background, structure[8])
    return n_object, len({int(labels[p]) for p in ((0, 1), (1, 0), (1, 2), (2, 1))} - {0})


def _loose_background(mask: Tensor) -> int:
    background = ~mask.numpy()
    background[1, 1] = False
    return int(scipy.ndimage.label(background)[1])


def _is_simple(mask: Tensor) -> bool:
    background = ~mask.numpy()
    background[1, 1] = False
    labels, _ = scipy.ndimage.label(background)
    touching = {int(labels[p]) for p in ((0, 1), (1, 0), (1, 2), (2, 1))} - {0}
    return _count(mask, 8)[0] == 1 and len(touching) == 1
