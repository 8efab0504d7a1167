"""Every parameter that Mitsuba 3.9.1 reads of the plugins that clvol has too, is known here by its name.

The names were found by giving each plugin of Mitsuba every word that stands in its libraries, as values of
ten types: those that are not its parameters it calls unreferenced.
"""

import pytest
from plugin_parameters import INSTEAD, PARAMETERS

from clvol.errors import Error
from clvol.scene import load_dict

MITSUBAS = {
    "cube": "face_normals flip_normals silhouette_sampling_weight to_world",
    "sphere": "center flip_normals radius silhouette_sampling_weight to_world",
    "rectangle": "face_normals flip_normals silhouette_sampling_weight to_world",
    "disk": "flip_normals silhouette_sampling_weight to_world",
    "cylinder": "flip_normals p0 p1 radius silhouette_sampling_weight to_world",
    "ply": "face_normals filename flip_normals flip_tex_coords silhouette_sampling_weight to_world",
    "obj": "face_normals filename flip_normals flip_tex_coords silhouette_sampling_weight to_world",
    "serialized": "face_normals filename flip_normals shape_index silhouette_sampling_weight to_world",
    "shapegroup": "silhouette_sampling_weight to_world",
    "instance": "silhouette_sampling_weight to_world",
    "constant": "radiance sampling_weight to_world",
    "directional": "direction irradiance sampling_weight to_world",
    "point": "intensity position sampling_weight to_world",
    "spot": "beam_width cutoff_angle intensity sampling_weight texture to_world",
    "projector": "focal_length fov fov_axis irradiance sampling_weight scale to_world",
    "area": "radiance sampling_weight to_world",
    "directionalarea": "radiance sampling_weight",
    "sunsky": (
        "albedo complex_sun day hour latitude longitude minute month sampling_weight second sky_scale "
        "sun_aperture sun_direction sun_scale timezone to_world turbidity year"
    ),
    "timed_sunsky": (
        "albedo complex_sun end_day end_month end_year latitude longitude sampling_weight shutter_close "
        "shutter_open sky_scale start_day start_month start_year sun_aperture sun_scale timezone to_world "
        "turbidity window_end_time window_start_time"
    ),
    "envmap": "bitmap filename mis_compensation sampling_weight scale to_world",
    "perspective": (
        "far_clip focal_length focus_distance fov fov_axis near_clip principal_point_offset_x "
        "principal_point_offset_y shutter_close shutter_open to_world"
    ),
    "thinlens": (
        "aperture_radius far_clip focal_length focus_distance fov fov_axis near_clip shutter_close "
        "shutter_open to_world"
    ),
    "orthographic": "far_clip focus_distance near_clip shutter_close shutter_open to_world",
    "irradiancemeter": "shutter_close shutter_open",
    "batch": "shutter_close shutter_open",
    "hdrfilm": (
        "banner compensate component_format crop_height crop_offset_x crop_offset_y crop_width "
        "file_format height pixel_format sample_border width"
    ),
    "tent": "radius",
    "gaussian": "stddev",
    "mitchell": "B C",
    "lanczos": "lobes",
    "independent": "sample_count seed",
    "stratified": "jitter sample_count seed",
    "multijitter": "jitter sample_count seed",
    "orthogonal": "jitter sample_count seed strength",
    "ldsampler": "sample_count seed",
    "homogeneous": "albedo has_spectral_extinction sample_emitters scale sigma_t",
    "heterogeneous": "albedo has_spectral_extinction sample_emitters scale sigma_t",
    "hg": "g",
    "tabphase": "values",
    "sggx": "S",
    "blendphase": "weight",
    "constvolume": "to_world value",
    "gridvolume": "accel data filename filter_type grid max_value raw to_world use_grid_bbox wrap_mode",
    "bitmap": "accel bitmap filename filter_type format raw to_uv wrap_mode",
    "volume": "volume",
    "checkerboard": "color0 color1 to_uv",
    "path": "block_size hide_emitters max_depth rr_depth samples_per_pass timeout",
    "volpath": "block_size hide_emitters max_depth rr_depth samples_per_pass timeout",
    "volpathmis": "block_size hide_emitters max_depth rr_depth samples_per_pass timeout use_spectral_mis",
    "direct": (
        "block_size bsdf_samples emitter_samples hide_emitters samples_per_pass shading_samples timeout"
    ),
    "ptracer": "hide_emitters max_depth rr_depth samples_per_pass timeout",
    "depth": "block_size hide_emitters samples_per_pass timeout",
    "moment": "block_size hide_emitters samples_per_pass timeout",
}
REFUSED = {
    ("area", "to_world"): "Mitsuba raises an error too",
}


@pytest.mark.parametrize("plugin", MITSUBAS)
def test_no_parameter_of_mitsubas_is_unknown(plugin):
    told = set(PARAMETERS[plugin][0]) | set(PARAMETERS[plugin][1]) | {n for p, n in INSTEAD if p == plugin}
    told |= {name for refused, name in REFUSED if refused == plugin}
    assert set(MITSUBAS[plugin].split()) <= told


def test_a_response_of_a_sensor_is_refused():
    response = {"type": "regular", "values": "0, 1"}
    sensor = {"type": "perspective", "fov": 40.0, "srf": response}
    with pytest.raises(Error, match="'srf' of sensor 'perspective' is not supported"):
        load_dict({"type": "scene", "sensor": sensor})


def test_a_shutter_that_closes_before_it_opens_is_refused():
    with pytest.raises(Error, match="shutter_close must not be before shutter_open"):
        load_dict({"type": "scene", "sensor": {"type": "perspective", "fov": 40.0, "shutter_open": 1.0}})


def test_a_limit_of_time_is_said_to_be_the_orders():
    integrator = {"type": "path", "timeout": 3.0}
    sensor = {"type": "perspective", "fov": 40.0}
    scene = load_dict({"type": "scene", "sensor": sensor, "integrator": integrator})
    assert "'timeout' of integrator 'path' is taken as no limit" in scene.approximated[0]
