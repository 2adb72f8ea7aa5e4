"""When a position of the raster goes into the datapath."""

from amaranth import Module, Mux, Signal
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out


class Issue(wiring.Component):
    """Issues a row's positions, one a clock, once its source rows are there; before the first row it warms up.

    With ``ahead`` the permission is a register that is renewed at the end of a row, and a row counts as issued when the
    position near its end is: in time for `RowFlow` to know, at the row's end, of the next row.

    Parameters
    ----------
    warm_up : bool
        Until the first end of a row, positions are stepped over without waiting for rows, and are not issued.
    ahead : bool

    Members
    -------
    enable : In(1)
        The pipeline moves on in this clock.
    may_issue : In(1)
        `RowFlow`.
    end_of_line, last_row, near_end : In(1)
        `Raster`.
    step, issue : Out(1)
        The raster's position is stepped over in this clock; as one of a frame.
    row_issued, frame_issued : Out(1)
        For `RowFlow`; registers with ``ahead``.
    """

    def __init__(self, warm_up=False, ahead=False):
        self._warm_up, self._ahead = warm_up, ahead
        super().__init__(
            {
                "enable": In(1),
                "may_issue": In(1),
                "end_of_line": In(1),
                "last_row": In(1),
                "near_end": In(1),
                "step": Out(1),
                "issue": Out(1),
                "row_issued": Out(1),
                "frame_issued": Out(1),
            }
        )

    def elaborate(self, platform):
        m = Module()
        warm = Signal(init=not self._warm_up)
        if self._warm_up:
            with m.If(self.step & self.end_of_line):
                m.d.sync += warm.eq(1)
        m.d.comb += self.issue.eq(self.step & warm)
        if self._ahead:
            permitted = Signal(init=self._warm_up)
            m.d.sync += [
                permitted.eq(Mux(self.step & self.end_of_line, self.may_issue, permitted | self.may_issue)),
                self.row_issued.eq(self.issue & self.near_end),
                self.frame_issued.eq(self.issue & self.near_end & self.last_row),
            ]
            m.d.comb += self.step.eq(self.enable & permitted)
        else:
            m.d.comb += [
                self.step.eq(self.enable & (self.may_issue | ~warm)),
                self.row_issued.eq(self.issue & self.end_of_line),
                self.frame_issued.eq(self.issue & self.end_of_line & self.last_row),
            ]
        return m
