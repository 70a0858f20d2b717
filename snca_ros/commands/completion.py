"""The `completion` command: prints the script with which a shell completes the other commands.

The script contains all completions: the shell does not start Python or load ROS for them.
"""

import argparse
import contextlib
from pathlib import Path

import shtab

from sim_node.engine import ENGINES
from sim_node.errors import InvalidInput, check_name
from sim_node.model.morphology import SHAPES
from sim_node.model.terrain import UNSEEN_TERRAINS
from snca_ros.bundled import bundled_controllers
from snca_ros.cell.architecture import ARCHITECTURES
from snca_ros.cell.models import NEURON_MODELS
from snca_ros.commands import COMMANDS, load_command
from snca_ros.evolution.strategies import STRATEGIES
from snca_ros.evolution.tasks import TASKS
from snca_ros.graph.executables import NODES

EXAMPLES = """
  snca completion bash > ~/.snca-completion         # and in ~/.bashrc: . ~/.snca-completion
  snca completion zsh > ~/.zfunc/_snca              # with ~/.zfunc in fpath
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `completion`."""
    parser.add_argument('shell', help=', '.join(shtab.SUPPORTED_SHELLS))


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Print the script; return the exit code."""
    check_name('shell', args.shell, shtab.SUPPORTED_SHELLS)
    root = argparse.ArgumentParser('snca')
    root.add_argument('--version', action='store_true')
    commands = root.add_subparsers()
    for name, text in COMMANDS.items():
        command = commands.add_parser(name, help=text)
        with contextlib.suppress(InvalidInput):  # without ROS only its name is completed
            load_command(name).add_arguments(command)
        _add_choices(command)
    for name, (_, text) in NODES.items():
        commands.add_parser(name, help=text)
    print(shtab.complete(root, args.shell))
    return 0


def _add_choices(command: argparse.ArgumentParser) -> None:
    """Set the choices of a command's options."""
    file = shtab.Choice('file')
    of_tasks = dict.fromkeys(TASKS[name].terrain for name in TASKS)
    choices = {
        'shape': SHAPES, 'architecture': ARCHITECTURES, 'neuron_model': NEURON_MODELS,
        'engine': ENGINES, 'strategy': STRATEGIES, 'task': TASKS,
        'terrain': (*of_tasks, *UNSEEN_TERRAINS),
        'controller': (file, *bundled_controllers()), 'controllers': (file, *bundled_controllers()),
        'source': (file, *bundled_controllers()), 'shell': shtab.SUPPORTED_SHELLS,
    }
    for action in command._actions:
        action.choices = choices.get(action.dest, (file,) if action.type is Path else None)
