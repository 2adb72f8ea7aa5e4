"""The search for word lengths where many of them share one error budget."""

from heapq import heapify, heappop, heappush

# How much precision, in bits of each word length, the search starts with beyond what is enough.
AMPLE = 2
# How many bits a word length may lose at once where one less saves nothing.
REACH = 3
# How much harder the limit for the sample becomes when what meets it does not do for the frame.
SHRINK = 0.9
# Less of the limit than this counts as this much when savings are set against the error that they cost.
LEAST = 0.01


def shortest(build, starts, fewest, *, error, limit, meets):
    """The cheapest candidate that a search finds from above; None where not even the most precise start is enough.

    From a little more than precise enough it takes bit after bit, the one that saves most for its error first, as long
    as the error at a sample of the pixels stays below a limit. Then all pixels are evaluated. If one of them is beyond
    the budget, which a sample does not rule out, the limit is lowered and the search begins anew; if none is, bits are
    taken as long as all pixels stay within it.

    Parameters
    ----------
    build : callable
        Makes a candidate of a dict of str to int, the word lengths. It has ``bits``, those or others that mean the
        same, and ``cost``, in any unit.
    starts : sequence
        Candidates, ever more precise.
    fewest : dict of str to int
        What word lengths must not fall below; those that are not named may.
    error : callable
        Largest error of a candidate at the sample.
    limit : float
        What ``error`` must not exceed in any case.
    meets : callable
        Whether all pixels of a candidate are within the budget.
    """
    # A search that begins anew goes the same way for long.
    build, error = _once(build, lambda bits: frozenset(bits.items())), _once(error, id)
    errors = [error(start) for start in starts]
    lower = limit
    while True:
        enough = next((index for index, reached in enumerate(errors) if reached <= lower), None)
        if enough is None:
            return None
        start = starts[min(enough + AMPLE, len(starts) - 1)]
        found = _shortened(build, start, fewest, error, lower)
        if meets(found):
            return _shortened(build, found, fewest, error, limit, meets)
        lower *= SHRINK


def _once(function, key):
    """``function`` of one argument that remembers what it returned for a ``key`` of it."""
    known = {}

    def once(argument):
        name = key(argument)
        if name not in known:
            known[name] = function(argument), argument  # kept: no other object gets its id
        return known[name][0]

    return once


def _shortened(build, best, fewest, error, limit, meets=lambda candidate: True):
    """What is left when no word length can lose bits any more."""
    while True:
        trials = []
        for name, bits in best.bits.items():
            least = max(bits - REACH, fewest.get(name, bits - REACH))
            shorter = (build({**best.bits, name: fewer}) for fewer in range(bits - 1, least - 1, -1))
            trial = next((trial for trial in shorter if trial.cost < best.cost), None)
            if trial:
                trials.append(trial)
        found = next((trial for trial in _by_gain(trials, best, error, limit) if meets(trial)), None)
        if not found:
            return best
        best = found


def _by_gain(trials, best, error, limit):
    """Those of ``trials`` that are within the limit, the one that saves most for its error first.

    No error costs less than `LEAST`; what cannot save more even so than one that is known waits for its evaluation.
    """
    least = LEAST * limit
    queue = [((trial.cost - best.cost) / least, False, index) for index, trial in enumerate(trials)]
    heapify(queue)
    while queue:
        _, known, index = heappop(queue)
        trial = trials[index]
        if known:
            yield trial
        elif (after := error(trial)) <= limit:
            heappush(queue, ((trial.cost - best.cost) / max(after - error(best), least), True, index))
