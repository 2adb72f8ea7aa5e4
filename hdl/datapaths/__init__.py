"""The datapaths by their command-line names; a new one is one file and one entry here."""

from hdl.datapaths.accumulate import Accumulate
from hdl.datapaths.affine import Affine
from hdl.datapaths.base import Datapath
from hdl.datapaths.conventional import Conventional
from hdl.datapaths.polynomial import Polynomial
from hdl.datapaths.proposed import Proposed
from hdl.datapaths.spline import Spline
from hdl.datapaths.table import Table

DATAPATHS: dict[str, type[Datapath]] = {
    datapath.name: datapath for datapath in (Conventional, Accumulate, Proposed, Affine, Polynomial, Spline, Table)
}
