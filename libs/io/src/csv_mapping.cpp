#include "vestibule/io/csv_mapping.hpp"

#include "vestibule/core/angles.hpp"

namespace vestibule::io {
namespace {

constexpr Bounds kDelays = within(-3600.0, 3600.0);

const std::vector<std::pair<std::string_view, CsvAxes>>& axesNames() {
  static const std::vector<std::pair<std::string_view, CsvAxes>> names{
      {"east_north", CsvAxes::kEastNorth}, {"north_east", CsvAxes::kNorthEast}};
  return names;
}

}  // namespace

void describe(ParamIo& io, CsvTime& time) {
  io.required("column", time.column);
  io.optional("unit_s", time.unit_s, positive());
}

void describe(ParamIo& io, CsvGnss& gnss) {
  static const std::vector<std::pair<std::string_view, GnssFixType>> kTypes{
      {"none", GnssFixType::kNone},
      {"unknown", GnssFixType::kUnknown},
      {"single", GnssFixType::kSingle},
      {"differential", GnssFixType::kDifferential},
      {"rtk_float", GnssFixType::kRtkFloat},
      {"rtk_fixed", GnssFixType::kRtkFixed}};
  io.required("name", gnss.name);
  io.optional("lat", gnss.lat);
  io.optional("lon", gnss.lon);
  io.optional("height", gnss.height);
  io.optional("x", gnss.x);
  io.optional("y", gnss.y);
  io.optional("z", gnss.z);
  io.optional("v_x", gnss.v_x);
  io.optional("v_y", gnss.v_y);
  io.optional("sigma_mps", gnss.sigma_mps, positive());
  io.optional("axes", gnss.axes, axesNames());
  io.optional("origin_m", gnss.origin_m, 2, 2);
  io.optional("type", gnss.type, kTypes);
  io.optional("sigma_m", gnss.sigma_m, positive());
  io.optional("sigma_vertical_m", gnss.sigma_vertical_m, positive());
  io.optional("optional", gnss.optional);
  io.optional("repeats_are_stale", gnss.repeats_are_stale);
  io.optional("delay_s", gnss.delay_s, kDelays);
  const bool geodetic = gnss.lat && gnss.lon && !gnss.x && !gnss.y && !gnss.z;
  const bool local = gnss.x && gnss.y && !gnss.lat && !gnss.lon && !gnss.height;
  if (!io.writing() && !geodetic && !local) {
    io.problem("", "needs either the columns lat and lon (and height), or x and y (and z)");
  }
  if (!io.writing() && gnss.v_x.has_value() != gnss.v_y.has_value()) {
    io.problem("", "a velocity needs both columns, v_x and v_y");
  }
}

void describe(ParamIo& io, CsvWheels& wheels) {
  io.required("left", wheels.left);
  io.required("right", wheels.right);
  io.optional("unit_mps", wheels.unit_mps, positive());
  io.required("track_m", wheels.track_m, positive());
  io.optional("distance_scale", wheels.distance_scale, positive());
  io.optional("max_dt_s", wheels.max_dt_s, positive());
  io.optional("optional", wheels.optional);
  io.optional("delay_s", wheels.delay_s, kDelays);
}

void describe(ParamIo& io, CsvHeading& heading) {
  io.required("column", heading.column);
  io.optional("unit_rad", heading.unit_rad, positive());
  io.optional("clockwise_from_north", heading.clockwise_from_north);
  io.optionalDegrees("offset_deg", heading.offset_rad, within(-360.0, 360.0));
  std::optional<double> sigma_deg;
  if (heading.sigma_rad) sigma_deg = radToDeg(*heading.sigma_rad);
  io.optional("sigma_deg", sigma_deg, positive());
  if (sigma_deg) heading.sigma_rad = degToRad(*sigma_deg);
  io.section("compass", heading.compass);
  io.optional("optional", heading.optional);
  io.optional("emit", heading.emit);
  io.optional("delay_s", heading.delay_s, kDelays);
}

void describe(ParamIo& io, CsvYawRate& yaw_rate) {
  io.optional("column", yaw_rate.column);
  io.optional("sign", yaw_rate.sign, within(-1.0, 1.0));
  io.optional("from_heading", yaw_rate.from_heading);
  io.optional("optional", yaw_rate.optional);
  io.optional("delay_s", yaw_rate.delay_s, kDelays);
  if (!io.writing() && yaw_rate.column.has_value() == yaw_rate.from_heading) {
    io.problem("", "needs either a column or from_heading: true");
  }
}

void describe(ParamIo& io, CsvReference& reference) {
  io.required("x", reference.x);
  io.required("y", reference.y);
  io.optional("yaw", reference.yaw);
  io.optional("axes", reference.axes, axesNames());
  io.optional("yaw_clockwise_from_north", reference.yaw_clockwise_from_north);
}

void describe(ParamIo& io, CsvMapping& mapping) {
  io.optional("description", mapping.description);
  io.optional("delimiter", mapping.delimiter);
  if (mapping.delimiter.size() != 1) {
    io.problem("delimiter", "must be one character, e.g. \",\", \";\" or \"\\t\"");
  }
  io.requiredSection("time", mapping.time);
  io.list("gnss", mapping.gnss);
  io.section("wheels", mapping.wheels);
  io.section("heading", mapping.heading);
  io.section("yaw_rate", mapping.yaw_rate);
  io.section("reference", mapping.reference);
  if (mapping.yaw_rate && mapping.yaw_rate->from_heading && !mapping.heading) {
    io.problem("yaw_rate", "from_heading needs a heading column");
  }
}

std::vector<std::string> CsvMapping::columns() const {
  std::vector<std::string> names{time.column};
  const auto add = [&](const std::optional<std::string>& name) {
    if (name) names.push_back(*name);
  };
  for (const CsvGnss& g : gnss) {
    for (const auto* name : {&g.lat, &g.lon, &g.height, &g.x, &g.y, &g.z, &g.v_x, &g.v_y})
      add(*name);
  }
  if (wheels) {
    names.push_back(wheels->left);
    names.push_back(wheels->right);
  }
  if (heading) names.push_back(heading->column);
  if (yaw_rate) add(yaw_rate->column);
  if (reference) {
    names.push_back(reference->x);
    names.push_back(reference->y);
    add(reference->yaw);
  }
  return names;
}

}  // namespace vestibule::io
