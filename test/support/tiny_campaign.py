"""A campaign of seconds, and ways to do it: in this process, as a command."""

import os
import subprocess
import sys
from pathlib import Path

import yaml

import snca_ros
from snca_ros.campaign.endpoints import perform
from snca_ros.campaign.results import Results
from snca_ros.campaign.scheduler import Campaign
from snca_ros.campaign.specification import read_campaign
from snca_ros.evolution.workers import IN_PROCESS

ROOT = Path(snca_ros.__file__).parents[1]

TINY = {
    'episodes': 40, 'population': 8, 'duration': 1, 'transient': 0.2, 'shape': 'worm-3x1',
    'seed': [0, 1], 'neuron_model': 'mlp',
    'cases': [{'architecture': 'U-D'}, {'architecture': 'nU-nD', 'engine': 'pymunk'}],
}


def write_file(folder: Path) -> Path:
    """Write the campaign file into a folder."""
    path = folder / 'tiny.yaml'
    path.write_text(yaml.safe_dump(TINY))
    return path


def work(file: Path, folder: Path, workers=IN_PROCESS) -> Campaign:
    """Do, or go on with, the campaign in a folder for both runs and results."""
    results = Results(folder / 'results')
    try:
        campaign = Campaign(read_campaign(file), results, folder / 'runs')
        campaign.work(workers)
    finally:
        results.close()
    return campaign


def contents(folder: Path) -> dict[str, bytes]:
    """Return all files of a results folder but its lock."""
    files = (path for path in folder.rglob('*') if path.is_file() and path.name != '.lock')
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def start(file: Path, folder: Path, *options: str) -> subprocess.Popen:
    """Start the command, with two workers if the options do not say otherwise."""
    return subprocess.Popen(
        [sys.executable, '-m', 'snca_ros', 'campaign', str(file), '--workers', '2', *options,
         '--results', str(folder / 'results'), '--runs', str(folder / 'runs')],
        env={**os.environ, 'PYTHONPATH': str(ROOT)}, text=True, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )


def generations(folder: Path) -> int:
    """Return the generations of all runs so far."""
    histories = (folder / 'runs').glob('*/history.csv')
    return sum(len(path.read_text().splitlines()) - 1 for path in histories)


def perform_or_die(config, path):
    """Perform a run, or end the process at runs named in DEADLY; worker processes import this."""
    if config.name in os.environ['DEADLY'].split():
        os._exit(3)
    return perform(config, path)
