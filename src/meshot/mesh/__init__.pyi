from .io import read_mesh as read_mesh, write_mesh as write_mesh
from .mesh import Contour as Contour, Mesh as Mesh, closed_contour as closed_contour
from .polygons import triangulate as triangulate
from .sampling import even_points as even_points, sample_locations as sample_locations, sample_points as sample_points
