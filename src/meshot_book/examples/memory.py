"""What a gradient costs in memory, counted, not timed."""

from collections.abc import Callable

from torch.autograd.graph import saved_tensors_hooks

from meshot.types import Tensor


class _Held:
    """A tensor that autograd keeps, and an account that hears when it lets go."""

    def __init__(self, tensor: Tensor, account: "_Account"):
        # The tensor itself may know the node that holds it, and the circle would never be let go.
        self.tensor, self.account = tensor.detach(), account
        account.change(tensor, +1)

    def __del__(self):
        self.account.change(self.tensor, -1)


class _Account:
    def __init__(self):
        self.holders: dict[int, int] = {}
        self.now, self.most = 0, 0

    def change(self, tensor: Tensor, by: int) -> None:
        """Count every piece of memory once, however many tensors look at it."""
        memory = tensor.untyped_storage()
        before = self.holders.get(memory.data_ptr(), 0)
        self.holders[memory.data_ptr()] = before + by
        if before == 0 or before + by == 0:
            self.now += by * memory.nbytes()
            self.most = max(self.most, self.now)


def peak_saved_bytes(function: Callable[[], object]) -> int:
    """The most bytes that autograd held for gradients at one time while ``function`` ran.

    Parameters
    ----------
    function : callable
        Makes the value and takes its gradient, so that what the backward pass holds is counted too.

    Notes
    -----
    Counted by hooks on every tensor that is saved: the same on every machine. Memory for the values themselves, and
    what a step needs for a moment, is not in it.
    """
    account = _Account()
    with saved_tensors_hooks(lambda tensor: _Held(tensor, account), lambda held: held.tensor):
        function()
    return account.most
