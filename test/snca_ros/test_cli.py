"""The `snca` command: overview, version, dispatch, and one line for a command that is none."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from support.limits import LIMIT

import snca_ros
from sim_node.model.constants import shown, values_of
from snca_ros import cli
from snca_ros.bundled import bundled_controllers
from snca_ros.cell.architecture import Architecture
from snca_ros.command_line import CommandParser
from snca_ros.commands.declared_options import DeclaredOption, FormerOption
from snca_ros.evolution.config import RunConfig

ROOT = Path(snca_ros.__file__).parents[1]


def python_m_snca_ros(*arguments, **options):
    return subprocess.run(
        [sys.executable, '-m', 'snca_ros', *arguments],
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        text=True, timeout=LIMIT, check=False, **options,
    )


@pytest.mark.parametrize('arguments', [[], ['-h'], ['--help']])
def test_help_names_every_command_and_node(arguments, capsys):
    assert cli.main(arguments) == 0
    out, err = capsys.readouterr()
    assert err == ''
    assert out.startswith('usage: snca COMMAND')
    listed = [line.split()[0] for line in out.splitlines() if line.startswith('  ')]
    assert [word for word in listed if word != 'snca'] == [*cli.COMMANDS, *cli.NODES]
    assert 'snca' in listed


@pytest.mark.parametrize('name', cli.NODES)
def test_help_of_a_node_has_its_parameters_in_a_column_of_their_own(name, capsys):
    assert cli.main([name, '--help']) == 0
    lines = capsys.readouterr().out.partition('parameters:\n')[2].partition('\n\n')[0]
    assert all(line[24] == ' ' and line[25] != ' ' for line in lines.splitlines())


def test_version(capsys):
    assert cli.main(['--version']) == 0
    assert capsys.readouterr().out == f'snca_ros {snca_ros.__version__}\n'


def test_every_command_and_node_has_a_module():
    modules = [f'snca_ros.commands.{name}' for name in cli.COMMANDS]
    for module in [*modules, *(module for module, _ in cli.NODES.values())]:
        assert (ROOT / (module.replace('.', '/') + '.py')).is_file()


def test_command_lines_are_read_in_commands_alone():
    readers = {
        str(path.relative_to(ROOT)) for package in ('sim_node', 'snca_ros')
        for path in (ROOT / package).rglob('*.py') if 'import argparse' in path.read_text()
    }
    elsewhere = {name for name in readers if not name.startswith('snca_ros/commands/')}
    assert elsewhere == {'snca_ros/command_line.py', 'snca_ros/nodes/voxel.py'}
    commands = {f'snca_ros/commands/{name}.py' for name in cli.COMMANDS}
    assert readers - elsewhere == {
        *commands, 'snca_ros/commands/body_options.py', 'snca_ros/commands/declared_options.py',
        'snca_ros/commands/json_output.py', 'snca_ros/commands/worker_options.py',
    }


@pytest.mark.parametrize('name', cli.NODES)
def test_a_node_describes_itself_and_starts_nothing(name, capsys):
    assert cli.main([name, '--help']) == 0
    out, err = capsys.readouterr()
    assert err == ''
    assert f'ros2 run snca_ros {name}' in out
    assert '\nparameters:\n' in out


@pytest.mark.parametrize(('name', 'argument'), [
    ('sim_node', '--params-file'), ('recorder_node', '--bag'), ('sim_node', 'biped'),
])
def test_a_node_refuses_arguments_without_ros_args(name, argument, capsys):
    assert cli.main([name, argument, 'F', '--ros-args', '-p', 'a:=1']) == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert f"snca {name}: error: arguments: got '{argument} F'" in err
    assert f"'snca {name} --help'" in err


@pytest.mark.parametrize(
    ('typo', 'meant'),
    [
        ('evolv', 'evolve'),
        ('wlak', 'walk'),
        ('simnode', 'sim_node'),
        ('voxel-node', 'voxel_node'),
        ('Report', 'report'),
    ],
)
def test_near_miss_is_told(typo, meant, capsys):
    assert cli.main([typo, '--seed', '3']) == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert err.count('\n') == 1
    assert repr(typo) in err
    assert f"did you mean '{meant}'?" in err


@pytest.mark.parametrize('name', ['xyzzy', '', '--verzion', '-x', 'evolve '])
def test_unknown_command_is_one_line(name, capsys):
    assert cli.main([name]) == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert err.endswith('\n')
    for known in (*cli.COMMANDS, *cli.NODES):
        assert known in err
    assert err.count('\n') == 1


def parser_of(name):
    return CommandParser(name, cli.COMMANDS[name], cli.load_command(name))


@pytest.mark.parametrize('name', cli.COMMANDS)
def test_help_explains_every_option_and_its_examples_are_no_errors(name):
    parser = parser_of(name)
    assert [action.dest for action in parser._actions if not action.help] == []
    examples = parser.format_help().partition('examples:\n')[2].splitlines()
    assert any(f'snca {name} ' in f'{example} ' for example in examples)
    for example in [*examples, *cli.EXAMPLES.strip().splitlines()]:
        words = shlex.split(example.partition('>')[0], comments=True)
        assert words[0] == 'snca'
        parser_of(words[1]).parse_args(words[2:])


REQUIRED = {
    'assess': ['x.npz'], 'bodies': ['x.npz', '--out', 'x'], 'campaign': ['x.yaml'],
    'policy': ['x.npz'], 'render': ['a.npz', 'b.gif'], 'replay': ['x.npz'],
    'voxels': ['x.npz', '--only', '1/2'],
}


def declared_options(name):
    """Return the options of a command that are declared constants."""
    return [
        action for action in parser_of(name)._actions
        if isinstance(action, DeclaredOption) and not isinstance(action, FormerOption)
    ]


def test_numbers_of_commands_are_declared():
    """But for those whose range depends on other input."""
    free = {
        (name, action.dest) for name in cli.COMMANDS for action in parser_of(name)._actions
        if action.type in (int, float)
    }
    assert free == {
        ('evolve', 'n_c'), ('render', 'columns'), ('replay', 'episode'), ('report', 'episode'),
    }


@pytest.mark.parametrize('name', ['walk', 'evolve', *REQUIRED])
def test_help_has_the_default_of_the_declaration(name):
    options = declared_options(name)
    assert options
    for action in options:
        assert action.default in (None, action.declared.default)
        if action.dest not in ('real_time', 'workers', 'faults'):  # lock-step; all cores; none
            default = shown(action.declared.default)
            assert re.search(rf'\(default {re.escape(default)}[,;)]', action.help), action.dest


def test_no_default_is_typed_into_a_help_text():
    """It is a placeholder of an f-string, or described in words after a colon."""
    typed = {
        (path.name, words) for path in (ROOT / 'snca_ros' / 'commands').glob('*.py')
        for words in re.findall(r"'[^']*\(default ([^:{'][^)]*)\)", path.read_text())
        if '{' not in words
    }
    assert typed == set()


def test_help_of_evolve_has_the_defaults_that_it_uses():
    config = RunConfig.named()
    cell = config.architecture
    helps = {action.dest: action.help for action in parser_of('evolve')._actions}
    for option, default in {
        'shape': config.shape, 'architecture': cell.name, 'neuron_model': cell.neuron_model,
        'sensors': ','.join(cell.sensors),
    }.items():
        assert f'(default {default})' in helps[option]
    for name in ('U-nD', 'U-D'):
        n_c = Architecture.named(name, config.architecture.neuron_model).n_c
        assert f'{n_c} {name.partition("-")[2]}' in helps['n_c']


@pytest.mark.parametrize('name', ['walk', 'evolve', *REQUIRED])
def test_a_value_that_is_off_is_named_with_its_option_and_range(name, capsys):
    checked = [a for a in declared_options(name) if 'form' not in a.declared.metadata]
    assert checked
    for action in checked:
        option, meta = action.option_strings[0], action.declared.metadata
        beyond = [str(meta['high'] + 1), 'nan'] if 'low' in meta else []
        for value in ['nonsense', '', *beyond]:
            assert cli.main([name, *REQUIRED.get(name, []), f'{option}={value}']) == 2
            out, err = capsys.readouterr()
            assert out == ''
            assert err.count('\n') == 1
            assert err.startswith(f'snca {name}: error: {option}: got ')
            assert values_of(action.declared) in err


@pytest.mark.parametrize(('arguments', 'hint'), [
    (['evolve', '--episods', '9'], "'--episods' (did you mean '--episodes'?)"),
    (['assess', 'x.npz', '--terains=flat'], "'--terains=flat' (did you mean '--terrains'?)"),
    (['report', 'bag', 'bog'], "unknown argument 'bog';"),
    (['report'], 'required: BAG'),
])
def test_wrong_options_are_one_line(arguments, hint, capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(arguments)
    assert end.value.code == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert err.count('\n') == 1
    assert hint in err


@pytest.mark.parametrize(('words', 'values', 'warning'), [
    ('walk --view NAME', {'controller': 'NAME', 'view': True, 'port': None}, ''),
    ('walk --real-time NAME', {'controller': 'NAME', 'real_time': True}, ''),
    ('report --html BAG', {'bag': Path('BAG'), 'html': True, 'page': None}, ''),
    ('walk --port 80 NAME', {'controller': 'NAME', 'port': 80}, ''),
    ('walk --view 80 NAME', {'controller': 'NAME', 'port': 80}, '--port 80'),
    ('walk NAME --view=80', {'controller': 'NAME', 'port': 80}, '--port 80'),
    ('walk NAME --real-time 0.5', {'real_time_factor': 0.5}, '--real-time-factor 0.5'),
    ('walk --view --real-time 2 NAME', {'controller': 'NAME', 'view': True,
                                        'real_time_factor': 2.0}, '--real-time-factor 2'),
    ('report --html walk.html BAG', {'bag': Path('BAG'), 'page': Path('walk.html')},
     '--page walk.html'),
    ('report BAG --html=page', {'bag': Path('BAG'), 'page': Path('page')}, '--page page'),
    ('report --html -- walk.html', {'bag': Path('walk.html'), 'html': True}, ''),
])
def test_a_flag_does_not_take_the_next_argument(words, values, warning, capsys):
    name, *arguments = words.split()
    parsed = parser_of(name).parse_args(arguments)
    assert {key: getattr(parsed, key) for key in values} == values
    err = capsys.readouterr().err
    assert err.count('\n') == bool(warning)
    assert f'use {warning}\n' in err if warning else not err


COMMANDS_WITH_RESULTS = {
    'walk', 'evolve', 'history', 'campaign', 'assess', 'bodies', 'study', 'report', 'render',
}


def test_every_command_that_prints_results_writes_them_as_json():
    found = {
        name for name in cli.COMMANDS
        if any('--json' in action.option_strings for action in parser_of(name)._actions)
    }
    assert found == COMMANDS_WITH_RESULTS


def test_no_option_takes_an_optional_value():
    """It would swallow a positional argument."""
    assert [
        (name, action.dest) for name in cli.COMMANDS for action in parser_of(name)._actions
        if action.option_strings and action.nargs in ('?', '*')
    ] == []


@pytest.mark.parametrize(('words', 'expected'), [
    ('re', {'report', 'replay', 'render', 'recorder_node'}),
    ('evolve --neuron', {'--neuron-model'}),
    ('evolve --shape bi', {'biped'}),
    ('assess bip', {*(n for n in bundled_controllers() if n.startswith('bip')), 'bipedal.npz'}),
    ('report b', {'bipedal.npz'}),
])
def test_bash_completes(words, expected, tmp_path, capsys):
    assert cli.main(['completion', 'bash']) == 0
    (tmp_path / 'completion.bash').write_text(capsys.readouterr().out)
    (tmp_path / 'bipedal.npz').touch()
    script = f"""source completion.bash
        COMP_WORDS=(snca {words}) COMP_CWORD={len(words.split())}
        _shtab_snca; printf '%s\\n' "${{COMPREPLY[@]}}" """
    run = subprocess.run(
        ['bash', '-c', script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert set(run.stdout.split()) == expected


def test_completion_of_an_unknown_shell_is_refused(capsys):
    assert cli.main(['completion', 'bsh']) == 2
    assert "did you mean 'bash'?" in capsys.readouterr().err


def test_without_ros_its_commands_say_what_is_missing():
    for words, code, said in [
        (['walk', 'bash'], 2, "pip install 'snca_ros[ros]'"), (['sim_node'], 2, 'ROS 2'),
        (['completion', 'bash'], 0, '_snca_evolve_option_strings'),
    ]:
        program = f"""import sys; sys.modules['rclpy'] = None
from snca_ros.cli import main; sys.exit(main({words}))"""
        run = subprocess.run(
            [sys.executable, '-c', program], env={**os.environ, 'PYTHONPATH': str(ROOT)},
            capture_output=True, text=True, check=False,
        )
        assert run.returncode == code, run.stderr
        assert said in run.stdout + run.stderr
        assert 'Traceback' not in run.stderr


def test_help_of_evolve_names_its_options(capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(['evolve', '--help'])
    assert end.value.code == 0
    out = capsys.readouterr().out
    assert out.startswith('usage: snca evolve')
    wanted = 'shape architecture neuron-model terrain episodes seed workers resume run'
    for option in wanted.split():
        assert f'--{option} ' in out


def test_ros_args_are_ignored_by_commands(capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(['evolve', '--help', '--ros-args', '-r', '__ns:=/x'])
    assert end.value.code == 0
    # What stands behind --ros-args is no error, what stands before it is.
    assert cli.main(['evolve', '--shape', 'bipd', '--ros-args', '--nonsense']) == 2
    assert "did you mean 'biped'?" in capsys.readouterr().err


def test_as_a_process():
    run = python_m_snca_ros('--version', capture_output=True)
    assert (run.returncode, run.stdout, run.stderr) == (0, f'snca_ros {cli.__version__}\n', '')
    run = python_m_snca_ros('evolv', capture_output=True)
    assert (run.returncode, run.stdout, run.stderr.count('\n')) == (2, '', 1)
    assert "did you mean 'evolve'?" in run.stderr


@pytest.mark.parametrize('unbuffered', ['', '1'])
def test_reader_that_has_gone_gets_no_traceback(unbuffered, monkeypatch):
    monkeypatch.setenv('PYTHONUNBUFFERED', unbuffered)
    read, write = os.pipe()
    os.close(read)
    try:
        run = python_m_snca_ros('--help', stdout=write, stderr=subprocess.PIPE)
    finally:
        os.close(write)
    assert run.stderr == ''
