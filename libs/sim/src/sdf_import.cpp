#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <sdf/Box.hh>
#include <sdf/Collision.hh>
#include <sdf/Console.hh>
#include <sdf/Cylinder.hh>
#include <sdf/Geometry.hh>
#include <sdf/Link.hh>
#include <sdf/Model.hh>
#include <sdf/Root.hh>
#include <sdf/World.hh>

#include "vestibule/core/errors.hpp"
#include "vestibule/sim/world.hpp"

namespace vestibule::sim {

void addSdf(World& world, const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path + ": no such file");
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  // From the text: models that the file only names are not looked up on the network.
  sdf::Console::Instance()->SetQuiet(true);  // its complaints come back as `errors`
  sdf::Root root;
  const sdf::Errors errors = root.LoadSdfString(text);
  if (root.WorldCount() == 0) {
    throw InputError(
        path + ": not a Gazebo world" +
        (errors.empty() ? std::string() : ": " + errors.front().Message()));
  }
  const sdf::World& source = *root.WorldByIndex(0);
  for (std::uint64_t m = 0; m < source.ModelCount(); ++m) {
    const sdf::Model& model = *source.ModelByIndex(m);
    for (std::uint64_t l = 0; l < model.LinkCount(); ++l) {
      const sdf::Link& link = *model.LinkByIndex(l);
      for (std::uint64_t c = 0; c < link.CollisionCount(); ++c) {
        const sdf::Collision& collision = *link.CollisionByIndex(c);
        const auto pose = model.RawPose() * link.RawPose() * collision.RawPose();
        const auto& geometry = *collision.Geom();
        const Point2 centre{pose.Pos().X(), pose.Pos().Y()};
        const sdf::Box* box_shape = geometry.BoxShape();
        const sdf::Cylinder* cylinder_shape = geometry.CylinderShape();
        double height_m = 0.0;
        if (box_shape != nullptr) height_m = box_shape->Size().Z();
        if (cylinder_shape != nullptr) height_m = cylinder_shape->Length();
        const double base_m = std::max(pose.Pos().Z() - 0.5 * height_m, 0.0);
        // What lies in the ground is the ground.
        const double above_m = pose.Pos().Z() + 0.5 * height_m - base_m;
        if (above_m <= 0.02) continue;
        if (box_shape != nullptr) {
          Box box;
          box.centre = centre;
          box.size_x_m = box_shape->Size().X();
          box.size_y_m = box_shape->Size().Y();
          box.yaw_rad = pose.Rot().Yaw();
          box.height_m = above_m;
          box.base_m = base_m;
          world.boxes.push_back(box);
        } else if (cylinder_shape != nullptr) {
          Circle circle;
          circle.centre = centre;
          circle.radius_m = cylinder_shape->Radius();
          circle.height_m = above_m;
          circle.base_m = base_m;
          world.circles.push_back(circle);
        }
      }
    }
  }
}

}  // namespace vestibule::sim
