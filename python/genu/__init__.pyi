from genu import plots as plots
from genu._asked import (
    Credibility as Credibility,
    NextTests as NextTests,
    Plan as Plan,
    Sweep as Sweep,
    credibility as credibility,
    next_tests as next_tests,
    plan as plan,
)
from genu._build import Build as Build, Frames as Frames
from genu._call import run as run
from genu._errors import (
    GenuError as GenuError,
    InputError as InputError,
    MachineError as MachineError,
    OptionError as OptionError,
    StageError as StageError,
    UsageError as UsageError,
)
from genu._grid import to_xarray as to_xarray
from genu._meshes import Hexahedra as Hexahedra, Surface as Surface, read_hexahedra as read_hexahedra, read_surface as read_surface
from genu._model import Model as Model
from genu._specimens import (
    Check as Check,
    Cohort as Cohort,
    Specimen as Specimen,
    check as check,
    cohort as cohort,
    cohort_infer as cohort_infer,
    init as init,
    inspect as inspect,
    options as options,
)
from genu._tables import read_table as read_table
from genu._verbs import (
    Calibration as Calibration,
    Diagnosis as Diagnosis,
    Validation as Validation,
    build as build,
    calibrate as calibrate,
    diagnose as diagnose,
    export as export,
    import_abaqus as import_abaqus,
    import_febio as import_febio,
    import_opensim as import_opensim,
    phantom as phantom,
    simulate as simulate,
    validate as validate,
)

__version__: str
