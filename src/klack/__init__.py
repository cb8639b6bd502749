"""klack predicts how a valve needle hits its end stops.

Contact force, contact time, restitution, bounces, and the structure-borne sound that follows.
"""

__all__ = ["__version__"]

__version__ = "0.1.0"
