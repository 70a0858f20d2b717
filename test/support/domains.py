"""ROS domains that no other test process on this machine uses at the same time."""

import socket

DOMAINS = range(1, 101)  # free of the kernel's ephemeral ports


def claim_domain() -> tuple[int, socket.socket]:
    """Return a free domain and its claim, which lasts as long as the socket and this process.

    The claim is the address of an abstract socket: the kernel gives it to one process at a time.
    """
    for domain in DOMAINS:
        claim = socket.socket(socket.AF_UNIX)
        try:
            claim.bind(f'\0snca_ros-test-domain-{domain}')
            return domain, claim
        except OSError:
            claim.close()
    raise RuntimeError(f'all ROS domains from {DOMAINS[0]} to {DOMAINS[-1]} are in use by tests')
