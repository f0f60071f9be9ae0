// XYZ THREADS: tree and normals; CGAL asks for k others and the query point itself, so 10.
#include <CGAL/Simple_cartesian.h>
#include <CGAL/pca_estimate_normals.h>
#include <CGAL/property_map.h>
#include <tbb/global_control.h>
#include "clock.hpp"

using Kernel = CGAL::Simple_cartesian<double>;
using Point = std::pair<Kernel::Point_3, Kernel::Vector_3>;

int main(int, char** arguments) {
    const auto values = positions(arguments[1]);
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, std::atoi(arguments[2]));
    std::vector<Point> points;
    points.reserve(values.size() / 3);
    for (size_t i = 0; i < values.size(); i += 3) points.push_back({{values[i], values[i + 1], values[i + 2]}, {}});
    const double cpu_before = cpu(), wall_before = wall();
    CGAL::pca_estimate_normals<CGAL::Parallel_if_available_tag>(points, 10,
        CGAL::parameters::point_map(CGAL::First_of_pair_property_map<Point>())
            .normal_map(CGAL::Second_of_pair_property_map<Point>()));
    tell(cpu_before, wall_before);
}
