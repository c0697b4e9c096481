from .carried import CarriedHead as CarriedHead
from .leaves import Leaves as Leaves
from .template import TemplateTissue as TemplateTissue, template_tissue as template_tissue
