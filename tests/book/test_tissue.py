"""From a probability to a sphere-like mesh: planted defects, then one hemisphere of the real average."""

import numpy as np
import pytest
import scipy.ndimage
import torch

from affines import FLIPPED, OBLIQUE
from meshot.anatomy.templates import fsaverage5_surface, mni152_brain_mask, mni152_t1, mni152_white_matter
from meshot.mesh.connectivity import SPHERE, self_intersecting_faces, topology
from meshot.mesh.geometry import signed_volume
from meshot.mesh.io import read_mesh, write_mesh
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere
from meshot.volume.surfaces import isosurface
from meshot.volume.volume import Volume, centre_ras, sample_volume, voxel_to_mm, white_matter_probability
from meshot_book.tissue import hemisphere_region, restricted, sphere_like_mesh, tissue_surface


def ball_with_defects(affine: np.ndarray) -> Volume:
    """A soft ball with a handle, a bridge of low probability, a cavity and a loose piece."""
    grid = np.stack(np.meshgrid(*(np.arange(40),) * 3, indexing="ij"), axis=-1) - 19.5
    radius = np.linalg.norm(grid, axis=-1)
    field = 1 / (1 + np.exp(2 * (radius - 12)))
    field[17:22, 17:22, :] = np.minimum(field[17:22, 17:22, :], 0.1)
    field[19:21, 19:21, 19:21] = 0.7
    field[10:13, 18:20, 18:20] = 0.0
    field[0:3, 0:3, 0:3] = 1.0
    return Volume(field, affine)


@pytest.mark.parametrize("affine", [np.eye(4), OBLIQUE, FLIPPED], ids=["plain", "oblique", "flipped"])
def test_defects_are_mended_in_any_space(affine):
    surface = tissue_surface(ball_with_defects(affine), n_faces=3000)
    assert topology(isosurface(surface.mask.with_data(surface.mask.data.astype(float)))).euler_number < 2
    assert topology(surface.mesh) == SPHERE
    assert len(self_intersecting_faces(surface.mesh)) == 0
    assert 2900 < len(surface.mesh.faces) <= 3000
    assert float(signed_volume(surface.mesh)) == pytest.approx(
        surface.genus_zero_mask.data.sum() * abs(np.linalg.det(affine)), rel=0.03
    )


def test_a_torus_is_refused():
    ring = np.zeros((9, 9, 5))
    ring[1:8, 1:8, 1:4] = 1
    ring[3:6, 3:6] = 0
    with pytest.raises(ValueError, match="not a topological sphere"):
        sphere_like_mesh(isosurface(Volume(ring, np.eye(4))), 100)


def test_a_mesh_that_cannot_be_made_coarser_is_returned_as_it_came():
    # Two thin lids that nearly touch: at twelve faces nothing is left of the gap.
    field = np.zeros((20, 20, 20))
    field[2:18, 2:18, 2:18] = 1
    field[2:17, 2:18, 9] = 0
    mesh = isosurface(Volume(field, np.eye(4)))
    kept = sphere_like_mesh(mesh, 24)
    assert topology(kept) == SPHERE
    assert len(self_intersecting_faces(kept)) == 0


def test_nothing_above_a_half_is_said():
    with pytest.raises(ValueError, match="mask is empty"):
        tissue_surface(Volume(np.full((5, 5, 5), 0.2), np.eye(4)))


def test_the_region_of_a_sphere_on_one_side():
    grid = Volume(np.zeros((60, 60, 60)), np.array([[1.0, 0, 0, -30], [0, 1, 0, -30], [0, 0, 1, -30], [0, 0, 0, 1]]))
    pial, white = (icosphere(4, radius, (-4.0, 0, 0)) for radius in (15.0, 12.0))
    region = hemisphere_region(grid, white, pial, "left", margin=1.5, depth=4.0)
    places = voxel_to_mm(region.allowed, torch.from_numpy(np.argwhere(region.allowed.data)).double())
    filled = voxel_to_mm(region.filled, torch.from_numpy(np.argwhere(region.filled.data)).double())
    centre = places.new_tensor([-4.0, 0, 0])
    assert float(places[:, 0].max()) == -1
    assert 15.5 < float((places - centre).norm(dim=1).max()) < 17.5
    assert 7 < float((filled - centre).norm(dim=1).max()) <= 8.2
    right = hemisphere_region(grid, white, pial, "right")
    assert (
        float(voxel_to_mm(right.allowed, torch.from_numpy(np.argwhere(right.allowed.data)).double())[:, 0].min()) == 1
    )


def test_along_the_medial_wall_there_is_no_margin():
    grid = Volume(np.zeros((60, 60, 60)), np.array([[1.0, 0, 0, -50], [0, 1, 0, -30], [0, 0, 1, -30], [0, 0, 0, 1]]))
    pial = icosphere(4, 15.0, (-20.0, 0, 0))
    centre = pial.vertices.new_tensor([-20.0, 0, 0])
    outwards = pial.vertices - centre
    white = pial.with_vertices(centre + torch.where(outwards[:, :1] > 7.5, 1.0, 0.8) * outwards)
    region = hemisphere_region(grid, white, pial, "left", margin=3.0)
    row = region.allowed.data[:, region.allowed.data.shape[1] // 2, region.allowed.data.shape[2] // 2]
    x = region.allowed.affine[0, 3] + np.flatnonzero(row)
    assert x.max() <= -5
    assert x.min() <= -37


def test_sides_and_grids_are_checked(unchecked):
    grid = Volume(np.zeros((40, 40, 40)), np.eye(4))
    pial, white = icosphere(3, 9.0, (-10.0, 9, 9)), icosphere(3, 7.0, (-10.0, 9, 9))
    with pytest.raises(ValueError, match="'left' or 'right'"):
        hemisphere_region(grid, white, pial, "top")
    with pytest.raises(ValueError, match="do not overlap"):
        hemisphere_region(Volume(grid.data, np.diag([1.0, 1, 1, 1]) + np.eye(4, k=3) * 300), white, pial, "left")
    region = hemisphere_region(grid, white, pial, "left")
    with pytest.raises(ValueError, match="share a grid"):
        restricted(Volume(np.zeros((80, 80, 80)), np.diag([0.5, 0.5, 0.5, 1])), region)
    with pytest.raises(ValueError, match="share a grid"):
        restricted(Volume(np.zeros((5, 5, 5)), np.eye(4)), region)


@pytest.fixture(scope="module")
def right_hemisphere() -> dict[str, Mesh]:
    """Initial surface (from the T1 alone) and target (from the white-matter map) of the MNI152 group average."""
    t1, white_matter = mni152_t1(), mni152_white_matter()
    region = hemisphere_region(t1, fsaverage5_surface("white", "right"), fsaverage5_surface("pial", "right"), "right")
    sources = {"initial": white_matter_probability(t1, mni152_brain_mask()), "target": white_matter}
    return {name: tissue_surface(restricted(source, region)).mesh for name, source in sources.items()}


@pytest.mark.parametrize("name", ["initial", "target"])
def test_surfaces_of_the_group_average_are_clean(right_hemisphere, name):
    mesh = right_hemisphere[name]
    assert topology(mesh) == SPHERE
    assert len(self_intersecting_faces(mesh)) == 0
    assert 40_000 <= len(mesh.faces) <= 100_000
    assert float(signed_volume(mesh)) > 0


@pytest.mark.parametrize("name", ["target.surf.gii", "rh.white", "target.ply"])
def test_written_targets_lie_at_the_half_of_the_map(right_hemisphere, tmp_path, name):
    white_matter = mni152_white_matter()
    write_mesh(tmp_path / name, right_hemisphere["target"], c_ras=centre_ras(white_matter))
    values = sample_volume(white_matter, read_mesh(tmp_path / name).vertices)
    # The rest lies on cuts that are no border of white matter: medial wall, filled ventricles, mended handles.
    assert float(values.median()) == pytest.approx(0.5, abs=0.01)
    assert float(((values - 0.5).abs() < 0.1).double().mean()) > 0.8


@pytest.mark.parametrize("affine", [OBLIQUE, FLIPPED], ids=["oblique", "flipped"])
@pytest.mark.parametrize("name", ["a.gii", "lh.white"])
def test_surfaces_from_askew_scans_return_to_scanner_space(tmp_path, affine, name):
    field = scipy.ndimage.gaussian_filter(np.pad(np.ones((12, 14, 16)), 8), 2.0)
    scan = Volume(field, affine)
    surface = tissue_surface(scan, n_faces=10**6).mesh
    write_mesh(tmp_path / name, surface, c_ras=centre_ras(scan))
    again = read_mesh(tmp_path / name)
    assert float(signed_volume(again)) > 0
    torch.testing.assert_close(
        sample_volume(scan, again.vertices), torch.full_like(again.vertices[:, 0], 0.5), atol=0.05, rtol=0
    )
