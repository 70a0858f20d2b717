"""Stand-ins for launch and launch_ros, which PyPI does not have.

As a program it starts the nodes that launch/robot.launch.py describes, as `ros2 launch` does, and
like that does not end them when it is terminated: python stand_in_launch.py argument:=value ...
"""

import os
import runpy
import subprocess
import sys
from types import ModuleType

from support.paths import ROOT

LAUNCH_FILE = ROOT / 'launch' / 'robot.launch.py'


class Recorded:
    """Remembers what it was made with."""

    def __init__(self, *arguments, **named):
        self.arguments, self.named = arguments, named


class LaunchConfiguration(Recorded):
    """The value of an argument: what was given in the context."""

    def perform(self, context):
        return context[self.arguments[0]]


_NAMES = {
    'launch': ('LaunchDescription',),
    'launch.actions': (
        'DeclareLaunchArgument', 'OpaqueFunction', 'RegisterEventHandler', 'Shutdown',
    ),
    'launch.event_handlers': ('OnShutdown',),
    'launch.substitutions': (),
    'launch_ros': (),
    'launch_ros.actions': ('Node',),
}


def stand_ins() -> dict[str, ModuleType]:
    """Return the modules by name, for sys.modules."""
    modules = {}
    for name, classes in _NAMES.items():
        modules[name] = ModuleType(name)
        for kind in classes:
            setattr(modules[name], kind, type(kind, (Recorded,), {}))
    modules['launch.substitutions'].LaunchConfiguration = LaunchConfiguration
    return modules


def describe() -> Recorded:
    """Return the description of the launch file; the stand-ins must be in sys.modules."""
    return runpy.run_path(str(LAUNCH_FILE))['generate_launch_description']()


def defaults(description: Recorded) -> dict[str, str]:
    """Return the default value of each launch argument."""
    *declared, _ = description.arguments[0]
    return {a.arguments[0]: a.named['default_value'] for a in declared}


def main() -> None:
    """Start the nodes and wait for them."""
    sys.modules.update(stand_ins())
    description = describe()
    *_, opaque = description.arguments[0]
    given = dict(word.split(':=') for word in sys.argv[1:])
    _, *nodes = opaque.named['function']({**defaults(description), **given})
    children = [
        subprocess.Popen(
            [sys.executable, '-m', 'snca_ros', n['executable'], *n['arguments'], '--ros-args',
             '-r', f'__ns:={n["namespace"]}', '--params-file', *n['parameters']],
            env={**os.environ, **n['additional_env']}, start_new_session=True,
        )
        for n in (node.named for node in nodes)
    ]
    print(*(child.pid for child in children), flush=True)
    for child in children:
        child.wait()


if __name__ == '__main__':
    main()
