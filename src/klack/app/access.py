"""Who may use the application: a random token, a session cookie, a password for other machines."""

import secrets
import time
from dataclasses import dataclass, field
from hashlib import scrypt
from hmac import compare_digest

from klack.errors import InputError

__all__ = ["LOCAL_HOSTS", "SHORTEST_PASSWORD", "Access", "PasswordGate", "access_for"]

LOCAL_HOSTS = ("127.0.0.1", "localhost", "::1")
SHORTEST_PASSWORD = 12  # characters
_PAUSE = 1.0  # [s] after a wrong password, for everybody


@dataclass
class PasswordGate:
    """A password, checked at most once a second after a wrong one.

    Parameters
    ----------
    password : str
        Kept only as its scrypt hash.
    """

    _salt: bytes
    _hash: bytes
    _closed_until: float = 0.0

    @classmethod
    def of(cls, password: str) -> "PasswordGate":
        """Gate for a password."""
        salt = secrets.token_bytes(16)
        return cls(salt, _hashed(password, salt))

    def opens(self, password: str) -> bool:
        """Whether this is the password; always False in the second after a wrong one."""
        now = time.monotonic()
        if now < self._closed_until:
            return False
        if compare_digest(_hashed(password, self._salt), self._hash):
            return True
        self._closed_until = now + _PAUSE
        return False


@dataclass(frozen=True, kw_only=True)
class Access:
    """What a request has to show.

    Parameters
    ----------
    host : str
        Address that the server listens on.
    port : int
    token : str
        In the URL that is printed; gives the session cookie in exchange where no password does.
    session : str
        Value of the cookie.
    gate : PasswordGate or None
        Where other machines may connect: gives the cookie instead of the token.
    names : tuple of str
        Host names by which browsers may call the server.
    """

    host: str
    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)
    session: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)
    gate: PasswordGate | None = field(default=None, repr=False)
    names: tuple[str, ...] = LOCAL_HOSTS

    @property
    def cookie(self) -> str:
        """Name of the cookie: cookies of one host are shared by all of its ports."""
        return f"klack_{self.port}"

    @property
    def url(self) -> str:
        """Address to open: with the token, or where a password is asked for without one."""
        start = f"http://{_with_port(self.names[0], self.port)}/"
        return start if self.gate is not None else f"{start}?token={self.token}"

    def is_own_host(self, header: str) -> bool:
        """Whether a ``Host`` header names this server, and not a name that was pointed at it."""
        return header.lower() in {_with_port(name, self.port) for name in self.names}

    def is_own_origin(self, header: str) -> bool:
        """Whether an ``Origin`` header is one of this server's own pages."""
        return header.lower() in {f"http://{_with_port(name, self.port)}" for name in self.names}


def access_for(host: str, port: int, password: str | None) -> Access:
    """Access to a server on a host.

    Raises
    ------
    InputError
        For a host other than the own machine without a password, or with a short one.
    """
    if host in LOCAL_HOSTS:
        return Access(host=host, port=port, names=(host, *LOCAL_HOSTS))
    if password is None:
        raise InputError(
            f"--host {host}",
            got="no password",
            expected="one, since other machines could connect",
            hint="klack app --host ... --password-file FILE, or leave --host out.",
        )
    if len(password) < SHORTEST_PASSWORD:
        raise InputError(
            "--password-file",
            got=f"a password of {len(password)} characters",
            expected=f"at least {SHORTEST_PASSWORD}",
            hint="use several words.",
        )
    return Access(
        host=host,
        port=port,
        gate=PasswordGate.of(password),
        names=(*_names_of(host), *LOCAL_HOSTS),
    )


def _names_of(host: str) -> tuple[str, ...]:
    """Names by which other machines may call a server that listens on ``host``."""
    import socket

    if host not in ("0.0.0.0", "::"):
        return (host.lower(),)
    own = socket.gethostname()
    found = dict.fromkeys([own, socket.getfqdn()])
    try:
        found |= dict.fromkeys(str(info[4][0]) for info in socket.getaddrinfo(own, None))
    except OSError:  # the name of this machine leads nowhere: its plain name stays
        pass
    return tuple(name.lower() for name in found)


def _with_port(name: str, port: int) -> str:
    return f"[{name}]:{port}" if ":" in name else f"{name}:{port}"


def _hashed(password: str, salt: bytes) -> bytes:
    return scrypt(password.encode(), salt=salt, n=2**14, r=8, p=1)
