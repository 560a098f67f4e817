"""The record of machine and versions that every benchmark result carries."""

from endosdk.jobs.machine import machine_record

__all__ = ["machine_record"]
