"""Subdivision of selected edges: more vertices on the same surface."""

import torch

from meshot.errors import as_indices, require_shape
from meshot.mesh.mesh import Mesh
from meshot.types import Bool, Int64, Tensor


def with_edges_split(mesh: Mesh, edges: Int64[Tensor, "E 2"]) -> Mesh:
    """The same surface with a new vertex at the midpoint of each given edge, and with its faces divided there.

    A face with one, two or three given edges is divided into two, three or four faces. Old vertices keep their indices;
    the vertex on the k-th edge has index V + k. Orientation and topology stay the same.

    Parameters
    ----------
    mesh : Mesh
    edges : tensor
        At least one pair of vertex indices, in any order, each edge once; see
        :func:`meshot.mesh.geometry.mesh_edges`.

    Raises
    ------
    ValueError
        If there is no pair, or a pair is not an edge of the mesh or appears twice.
    """
    n_vertices = len(mesh.vertices)
    edges = as_indices(edges, "edges", n_vertices).to(mesh.faces.device)
    require_shape(edges, "edges", 2)
    new = _new_vertices(mesh, edges)  # (F, 3): on the sides ab, bc, ca, or −1
    marks = (new >= 0).long()
    # Rotate the corners so that a single divided edge is ab, and a single undivided edge is ca.
    count = marks.sum(dim=1)
    turn = torch.where(count == 1, marks.argmax(dim=1), torch.where(count == 2, marks.argmin(dim=1) + 1, 0))
    order = (torch.arange(3, device=turn.device) + turn[:, None]) % 3
    a, b, c = mesh.faces.gather(1, order).T
    ab, bc, ca = new.gather(1, order).T
    parts = [
        _faces(count == 0, (a, b, c)),
        _faces(count == 1, (a, ab, c), (ab, b, c)),
        _faces(count == 2, (ab, b, bc), (a, ab, bc), (a, bc, c)),
        _faces(count == 3, (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)),
    ]
    return Mesh(torch.cat([mesh.vertices, mesh.vertices[edges].mean(dim=1)]), torch.cat(parts))


def _new_vertices(mesh: Mesh, edges: Int64[Tensor, "E 2"]) -> Int64[Tensor, "F 3"]:
    """The index of the new vertex on the sides ab, bc, ca of every face; −1 if the side is not divided."""
    n_vertices, n_edges = len(mesh.vertices), len(edges)
    sides = torch.stack([mesh.faces, mesh.faces.roll(-1, dims=1)], dim=2).sort(dim=2).values
    wanted = edges.sort(dim=1).values
    wanted, order = torch.sort(wanted[:, 0] * n_vertices + wanted[:, 1])
    if bool((wanted.diff() == 0).any()):
        raise ValueError("edges names an edge twice; name each once")
    sides = sides[..., 0] * n_vertices + sides[..., 1]
    place = torch.searchsorted(wanted, sides).clamp(max=n_edges - 1)
    found = wanted[place] == sides
    known = torch.zeros(n_edges, dtype=torch.bool, device=edges.device)
    known[place[found]] = True
    if not bool(known.all()):
        pair = edges[order[~known][0]].tolist()
        raise ValueError(f"edges names {pair}, which no face has for a side; take pairs from mesh_edges")
    return torch.where(found, n_vertices + order[place], -1)


def _faces(which: Bool[Tensor, " F"], *parts: tuple[Tensor, Tensor, Tensor]) -> Int64[Tensor, "G 3"]:
    return torch.cat([torch.stack(part, dim=1)[which] for part in parts])
