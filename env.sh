# Open Tablerunner's environment in this shell (bash or zsh): source ./env.sh
#
# Afterwards `tablerunner` is on PATH, the packages can be imported, and the node executables are in
# install/PACKAGE/lib/PACKAGE/. Source it from anywhere, as often as you like.

if [ -n "${BASH_VERSION:-}" ]; then
  _tablerunner_root=$(cd "$(dirname "${BASH_SOURCE[0]}")" > /dev/null && pwd -P)
  _tablerunner_shell=bash
elif [ -n "${ZSH_VERSION:-}" ]; then
  eval '_tablerunner_root=${${(%):-%x}:A:h}'
  _tablerunner_shell=zsh
else
  echo 'env.sh: use bash or zsh.' >&2
  return 1
fi

_tablerunner_open() {
  if [ ! -f "$_tablerunner_root/install/.way" ]; then
    echo "env.sh: nothing is built yet: run 'make setup' in $_tablerunner_root first." >&2
    return 1
  fi
  if [ "$(cat "$_tablerunner_root/install/.way")" = ros ]; then
    if [ "${ROS_DISTRO:-}" != jazzy ]; then
      echo 'env.sh: this workspace was built on ROS 2 Jazzy: source /opt/ros/jazzy/setup.bash first.' >&2
      return 1
    fi
  else
    export VIRTUAL_ENV=$_tablerunner_root/.venv
    case ":$PATH:" in
      *":$VIRTUAL_ENV/bin:"*) ;;
      *) export PATH=$VIRTUAL_ENV/bin:$PATH ;;
    esac
    # Unset, each Python that starts finds the wheels' libraries anew.
    unset _ROS_WHEELS_BOOTSTRAP_COMPLETE
  fi

  . "$_tablerunner_root/install/local_setup.$_tablerunner_shell"

  if [ -n "${VIRTUAL_ENV:-}" ] && [ "$(cat "$_tablerunner_root/install/.way")" = wheels ]; then
    # The wheels have their resource index in the environment itself, below the workspace.
    case ":$AMENT_PREFIX_PATH:" in
      *":$VIRTUAL_ENV:"*) ;;
      *) export AMENT_PREFIX_PATH=$AMENT_PREFIX_PATH:$VIRTUAL_ENV ;;
    esac
  fi
}

# colcon's scripts read variables that may be unset.
case $- in
  *u*) set +u; _tablerunner_open; _tablerunner_code=$?; set -u ;;
  *) _tablerunner_open; _tablerunner_code=$? ;;
esac
unset -f _tablerunner_open
unset _tablerunner_root _tablerunner_shell
return $_tablerunner_code
