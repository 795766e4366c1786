"""Who asks for security has it or does not start: ROS itself leaves it out in silence where the words are not quite its own."""

import os

from sand_sim.scene.types import SceneError

_ENABLE, _STRATEGY, _KEYSTORE = "ROS_SECURITY_ENABLE", "ROS_SECURITY_STRATEGY", "ROS_SECURITY_KEYSTORE"
_ENFORCE = "Enforce"
_STRATEGIES = (_ENFORCE, "Permissive")
_YES = ("true", "1", "yes", "on")


def demand_security() -> None:
    """Make ROS refuse to start where it is asked for security and has none; to be called before it starts.

    ROS takes ``true`` alone for yes, and every strategy but ``Enforce``, also none, for ``Permissive``, which runs unprotected
    where no enclave is found.

    Raises:
        SceneError: if what is asked for is none of ROS's words, and so would not be heard, or there are no keys for it.
    """
    asked = os.environ.get(_ENABLE, "")
    if asked != "true":
        if asked.lower() in _YES:
            raise SceneError(f"{_ENABLE}: ROS takes 'true' alone for yes, not '{asked}'")
        return
    strategy = os.environ.get(_STRATEGY) or _ENFORCE
    if strategy not in _STRATEGIES:
        raise SceneError(f"{_STRATEGY}: unknown '{strategy}'; known are {', '.join(_STRATEGIES)}")
    if strategy == _ENFORCE and not os.environ.get(_KEYSTORE):  # of which ROS says "error not set"
        raise SceneError(f"{_KEYSTORE}: is not set, but {_ENABLE} asks for security; name the folder of the keys")
    os.environ[_STRATEGY] = strategy
