"""LLVM IR to callable machine code, through numba's own back end (llvmlite)."""

from __future__ import annotations

import llvmlite.binding as llvm


def _target() -> llvm.TargetMachine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple()
    features = llvm.get_host_cpu_features().flatten()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=2, jit=True)


class MachineCode:
    """A compiled module; its functions live as long as this object does.

    Parameters
    ----------
    ir : str
        LLVM IR with opaque pointers.
    """

    def __init__(self, ir: str) -> None:
        machine = _target()
        module = llvm.parse_assembly(ir)
        module.verify()
        options = llvm.create_pipeline_tuning_options(speed_level=2)
        builder = llvm.create_pass_builder(machine, options)
        builder.getModulePassManager().run(module, builder)
        # The execution engine takes over the module and the target machine: each has its own.
        self._engine = llvm.create_mcjit_compiler(module, machine)
        self._engine.finalize_object()

    def address(self, name: str) -> int:
        """Address of one of its functions."""
        return int(self._engine.get_function_address(name))
