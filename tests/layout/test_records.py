"""The device sees the records that the host writes."""

from dataclasses import replace

import numpy as np
import pyopencl as cl
from probe import Probe, medium_of, scene_of

from clvol import layout
from clvol.scene.records import ConstVolume, IrradianceMeter, Shape


def test_records_have_the_same_sizes_and_offsets_on_the_device(device):
    lines, expected = [], []
    for name, dtype in layout.RECORDS.items():
        lines.append(f"{{ __global {name} *r = (__global {name} *)out0;")
        lines.append(f"*p++ = (uint)sizeof({name});")
        expected.append(dtype.itemsize)
        for field in dtype.names:
            lines.append(f"*p++ = (uint)((__global char *)&r->{field} - (__global char *)r);")
            lines.append(f"*p++ = (uint)sizeof(r->{field});")
            expected += [dtype.fields[field][1], dtype[field].itemsize]
        lines.append("}")
    body = "if (i > 0) return;\n__global uint *p = out0;\n" + "\n".join(lines)
    out = np.zeros(len(expected), np.uint32)
    everything = replace(medium_of(1.0), emission_density=ConstVolume((1.0,)))  # with the rare records
    meter = IrradianceMeter(Shape("rectangle", np.eye(4)))
    Probe(device, scene_of(everything, sensor=meter)).run([], body, [out])
    assert out.tolist() == expected


def test_a_record_written_by_the_host_is_read_field_by_field(device):
    """A value of each kind and place in the Medium record, through a buffer of two records."""
    media = np.zeros(2, layout.MEDIUM)
    media[1]["box_upper"], media[1]["cell_size"], media[1]["kd_root"] = (1, 2, 3), 0.25, -7
    out = np.zeros(5, np.float32)
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    probe = Probe(device, scene_of(medium_of(1.0)))
    probe.buffers["media"] = cl.Buffer(device.context, flags, hostbuf=media)
    body = """
        __global const Medium *m = scene->media + 1;
        const float v[5] = {m->box_upper[0], m->box_upper[1], m->box_upper[2], m->cell_size, m->kd_root};
        out0[i] = v[i];"""
    probe.run([], body, [out])
    assert out.tolist() == [1, 2, 3, 0.25, -7]
