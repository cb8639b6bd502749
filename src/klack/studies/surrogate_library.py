"""Whether the library that fits surrogates is installed."""

from klack.errors import MissingExtraError

__all__ = ["require_scikit_learn"]


def require_scikit_learn() -> None:
    """Raise :class:`MissingExtraError` unless scikit-learn is there."""
    try:
        import sklearn.gaussian_process
        import sklearn.linear_model  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("scikit-learn", "A surrogate", "surrogate") from error
