from .encodings import (
    ENCODINGS as ENCODINGS,
    Encoding as Encoding,
    SampleEncoding as SampleEncoding,
    SurfaceEncoding as SurfaceEncoding,
    VarifoldEncoding as VarifoldEncoding,
)
from .measure_losses import (
    LOSSES as LOSSES,
    ChamferLoss as ChamferLoss,
    MeasureLoss as MeasureLoss,
    SinkhornLoss as SinkhornLoss,
    SlicedLoss as SlicedLoss,
    WindowedLoss as WindowedLoss,
)
from .surfaces import (
    SummedLoss as SummedLoss,
    SurfaceLoss as SurfaceLoss,
    loss_setting_names as loss_setting_names,
    surface_loss as surface_loss,
)
