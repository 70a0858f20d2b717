"""What robots are evolved for, one file each, found by name.

To add a task, write a class like `walk.Walk` (`task.Task` says what it needs) and register one of
its objects by `TASKS.register`, see `sim_node.registry` and docs/python.md.

Controller files name their task, and the code that reads them is below evolution. So this folder
is a room of its own below that code: it imports neither engines nor evolution.
"""

from sim_node.errors import InvalidInput, check_name
from sim_node.model.terrain import parse_terrain
from sim_node.registry import Registry
from snca_ros.evolution.tasks.climb import Climb
from snca_ros.evolution.tasks.economy import Economy
from snca_ros.evolution.tasks.jump import Jump
from snca_ros.evolution.tasks.task import RECORDS, Episode, Scored, Task, score_of
from snca_ros.evolution.tasks.walk import Walk

__all__ = [
    'DEFAULT_TASK', 'RECORDS', 'TASKS', 'Climb', 'Economy', 'Episode', 'Jump', 'Scored', 'Task',
    'Walk', 'check_task', 'score_of',
]

DEFAULT_TASK = 'walk'
"""The task of the paper, and of files from before there were others."""



class TaskRegistry(Registry[Task]):
    """Tasks by name."""

    def register(self, name: str, entry: Task) -> None:
        """Add a task.

        Raises:
            InvalidInput: it is no object of a class derived from `Task` with a quantity and a unit,
                its terrain is none, or the name is taken.
        """
        where = f'{self.kind} {name}'
        if not isinstance(entry, Task):
            raise InvalidInput(where, entry, 'an object of a class derived from Task')
        for field in ('quantity', 'unit'):
            if not isinstance(getattr(entry, field, None), str):
                value = getattr(entry, field, None)
                raise InvalidInput(f'{where}.{field}', value, "a string, such as 'm/s'")
        if not isinstance(entry.records, tuple):
            raise InvalidInput(f'{where}.records', entry.records, "a tuple, as ('actuation',)")
        try:
            parse_terrain(entry.terrain)
        except InvalidInput as error:
            raise InvalidInput(f'{where}.terrain', error.value, error.expected) from None
        super().register(name, entry)


TASKS = TaskRegistry('task', {
    DEFAULT_TASK: Walk(), 'jump': Jump(), 'climb': Climb(), 'economy': Economy(),
})
"""Tasks by name."""


def check_task(name: str) -> Task:
    """Return the task of that name if what it records exists.

    Raises:
        InvalidInput: there is no such task, or it asks for arrays that are not recorded.
    """
    task = TASKS.find(name)
    for record in task.records:
        check_name(f'records of task {name}', record, RECORDS)
    return task
