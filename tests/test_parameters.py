"""What a parameter says to a wrong value: next to an end of its range with all digits, elsewhere shortly."""

import numpy as np
import pytest

from brdfdb.models.oren_nayar_1994 import RHO, SIGMA


@pytest.mark.parametrize(
    ("parameter", "value", "message"),
    [
        (RHO, 1.5, "rho: 1.5 is outside [0, 1]"),
        (RHO, 1.0 + 2.0**-52, "rho: 1.0000000000000002 is outside [0.0, 1.0]"),
        (SIGMA, 1.5708, "sigma: 1.5708 is outside [0.0, 1.5707963267948966] rad"),
        (SIGMA, [0.1, -2.0], "sigma: -2 is outside [0, 1.5708] rad"),
        (RHO, np.nan, "rho: nan is outside [0, 1]"),
    ],
)
def test_a_wrong_value_can_be_told_from_the_end_of_the_range(parameter, value, message):
    with pytest.raises(ValueError) as caught:  # noqa: PT011  # the whole message is looked at
        parameter.check(value)
    assert str(caught.value) == message
