$card
!
! Fortran 2003, no library, no allocation, no state: thread-safe. Compile with
!     gfortran -std=f2003 -O3 -march=native -c FILE.f90
!
! Inputs: $inputs.
! Loads: $loads.
module $prefix
    use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
    implicit none
    private
    public :: ${prefix}_loads, ${prefix}_loads_batch
    integer, parameter, public :: ${prefix}_kind = kind($one)
    integer, parameter, public :: ${prefix}_inputs = $count, ${prefix}_outputs = $outputs
    integer, parameter :: rk = ${prefix}_kind, inputs_ = $count, loads_ = $outputs
    integer, parameter :: heads_ = $heads, descriptions = $descriptions
    integer, parameter :: features_ = $features, incidence = $incidence + 1
    integer, parameter :: layers = $layers, widest = $widest, nodes = $nodes
    integer :: i_
$data

contains

    !> Loads of one case. status: 0 inside the trained ranges, 1 outside of them (extrapolated), 2 if
    !> an input is not finite or beyond what the flow solver accepts; loads and jacobian are NaN then.
    !> jacobian(load, input) = d loads / d inputs.
    pure subroutine ${prefix}_loads(inputs, loads, status, jacobian)
        real(rk), intent(in) :: inputs(inputs_)
        real(rk), intent(out) :: loads(loads_)
        integer, intent(out) :: status
        real(rk), intent(out), optional :: jacobian(loads_, inputs_)
        real(rk) :: s(inputs_), z(features_), f(heads_), image(heads_), step(inputs_), cd
        real(rk) :: by(heads_, features_), by_image(heads_, features_), waves(0:4), slopes(0:4)
        integer :: j, k, l

        loads = 0
        if (present(jacobian)) jacobian = 0
        status = status_of(inputs)
        if (status == 2) then
            loads = ieee_value(loads, ieee_quiet_nan)
            if (present(jacobian)) jacobian = ieee_value(jacobian, ieee_quiet_nan)
            return
        end if
        do k = 1, inputs_
            step(k) = scale_(k)
            s(k) = scale_(k) * inputs(k) + shift_(k)
            if (logs(k)) then
                s(k) = scale_(k) * log(inputs(k)) + shift_(k)
                step(k) = scale_(k) / inputs(k)
            end if
        end do
        call evaluate_waves(s, waves, slopes)
        z = s(source) * waves(wave)
        call evaluate(z, f, by, present(jacobian))
        if (loads_ > 1) then ! the part that is even (Cd) or odd (Cl, Cm) under the mirror image
            call evaluate(mirror * z, image, by_image, present(jacobian))
            do l = 1, loads_
                f(l) = (f(l) + parity(l) * image(l)) / 2
                if (present(jacobian)) by(l, :) = (by(l, :) + parity(l) * mirror * by_image(l, :)) / 2
            end do
        end if
        cd = exp(f(1))
        loads(1) = cd
        loads(2:) = cd * f(2:loads_)
        if (present(jacobian)) then
            f(1) = 0 ! Cd is no multiple of itself
            do j = 1, features_
                do l = 1, loads_
                    image(l) = cd * (by(l, j) + f(l) * by(1, j))
                end do
                k = source(j)
                if (k /= incidence) jacobian(:, k) = jacobian(:, k) + image(1:loads_) * waves(wave(j))
                k = max(incidence, 1)
                if (incidence > 0) jacobian(:, k) = jacobian(:, k) + image(1:loads_) * s(source(j)) * slopes(wave(j))
            end do
            do k = 1, inputs_
                jacobian(:, k) = jacobian(:, k) * step(k)
            end do
        end if
    end subroutine ${prefix}_loads

    !> Loads of many cases: inputs(input, case), loads(load, case), jacobian(load, input, case).
    pure subroutine ${prefix}_loads_batch(inputs, loads, status, jacobian)
        real(rk), intent(in) :: inputs(:, :)
        real(rk), intent(out) :: loads(:, :)
        integer, intent(out) :: status(:)
        real(rk), intent(out), optional :: jacobian(:, :, :)
        integer :: case

        do case = 1, size(inputs, 2)
            if (present(jacobian)) then
                call ${prefix}_loads(inputs(:, case), loads(:, case), status(case), jacobian(:, :, case))
            else
                call ${prefix}_loads(inputs(:, case), loads(:, case), status(case))
            end if
        end do
    end subroutine ${prefix}_loads_batch

    pure integer function status_of(inputs) result(status)
        real(rk), intent(in) :: inputs(inputs_)
        real(rk) :: values(inputs_), other(inputs_)
        integer :: d

        status = 2
        if (.not. all(inputs >= least .and. inputs <= most)) return ! so NaN is refused too
        values = inputs
        values(inputs_) = log(inputs(inputs_))
        status = 1
        do d = 1, descriptions ! of the body or of its mirror image
            other = signs(:, d) * values + offsets(:, d)
            if (all(other >= low .and. other <= high)) status = 0
        end do
    end function status_of

    !> 1 and the waves of the incidence by which features are multiplied, and their derivatives in its
    !> scaled input, which is set to 1.
    pure subroutine evaluate_waves(s, waves, slopes)
        real(rk), intent(inout) :: s(inputs_)
        real(rk), intent(out) :: waves(0:4), slopes(0:4)
        real(rk) :: a
        integer :: n

        waves = 0
        slopes = 0
        waves(0) = 1
        if (incidence < 1) return
        a = angle(1) * s(max(incidence, 1))
        do n = 1, 2
            waves(2 * n - 1:2 * n) = [cos(n * a), sin(n * a)]
            slopes(2 * n - 1:2 * n) = n * angle(1) * [-waves(2 * n), waves(2 * n - 1)]
        end do
        s(max(incidence, 1)) = 1
    end subroutine evaluate_waves

    !> Outputs before they are made even or odd, and their derivatives in the features z.
    pure subroutine evaluate(z, f, by, with_derivatives)
        real(rk), intent(in) :: z(features_)
        real(rk), intent(out) :: f(heads_), by(heads_, features_)
        logical, intent(in) :: with_derivatives
        real(rk) :: trace(nodes), values(widest), back(widest), next(widest), slope(features_)
        integer :: layer, rows, columns, from, weight, bias, i, l

        by = 0
        trace(1:features_) = z
        from = 0
        weight = 0
        bias = 0
        do layer = 1, layers
            rows = sizes(layer + 1)
            columns = sizes(layer)
            do i = 1, rows
                values(i) = biases(bias + i) + dot_product( &
                    weights(weight + (i - 1) * columns + 1:weight + i * columns), &
                    trace(from + 1:from + columns))
            end do
            from = from + columns
            if (layer < layers) trace(from + 1:from + rows) = tanh(values(1:rows))
            weight = weight + rows * columns
            bias = bias + rows
        end do
        do l = 1, heads_
            slope = matmul(quadratic(:, :, l), z)
            f(l) = constant(l) + dot_product(linear(:, l) + slope, z) + values(l)
            if (.not. with_derivatives) cycle
            columns = sizes(layers)
            from = nodes
            weight = size(weights) - heads_ * columns
            back(1:columns) = weights(weight + (l - 1) * columns + 1:weight + l * columns)
            do layer = layers - 1, 1, -1 ! backpropagation
                rows = sizes(layer + 1)
                columns = sizes(layer)
                from = from - rows
                weight = weight - rows * columns
                back(1:rows) = back(1:rows) * (1 - trace(from + 1:from + rows)**2)
                next(1:columns) = 0
                do i = 1, rows
                    next(1:columns) = next(1:columns) &
                        + back(i) * weights(weight + (i - 1) * columns + 1:weight + i * columns)
                end do
                back(1:columns) = next(1:columns)
            end do
            by(l, :) = linear(:, l) + 2 * slope + back(1:features_)
        end do
        if (incidence > 0) call sum_up_moment(z, f, by, with_derivatives)
    end subroutine evaluate

    !> The parts of the moment of 3-D bodies at incidence are summed up.
    pure subroutine sum_up_moment(z, f, by, with_derivatives)
        real(rk), intent(in) :: z(features_)
        real(rk), intent(inout) :: f(heads_), by(heads_, features_)
        logical, intent(in) :: with_derivatives
        real(rk) :: inertia, own
        integer :: l, k

        inertia = 1 / (1 + inertial(1) * exp((shift_(inputs_) - z(features_)) / scale_(inputs_)))
        own = f(loads_)
        f(loads_) = inertia * own
        if (with_derivatives) then
            by(loads_, :) = inertia * by(loads_, :)
            by(loads_, features_) = by(loads_, features_) &
                + own * inertia * (1 - inertia) / scale_(inputs_)
        end if
        l = loads_ + 1
        do while (l <= heads_) ! compilers warn of a loop by a counter that makes no trips
            k = stokes(l - loads_)
            f(loads_) = f(loads_) + z(k) * f(l)
            if (with_derivatives) then
                by(loads_, :) = by(loads_, :) + z(k) * by(l, :)
                by(loads_, k) = by(loads_, k) + f(l)
            end if
            l = l + 1
        end do
    end subroutine sum_up_moment
end module $prefix
